//! Random words and their transforms: Philox counters, streams of them, and normals, truncated normals and
//! log-uniform numbers by polynomials of our own. A shader fragment of the same name is each one's twin, to the bit.

pub(crate) mod alias;
pub(crate) mod log_uniform;
pub(crate) mod normal;
pub(crate) mod philox;
pub(crate) mod real;
pub(crate) mod stream;
pub(crate) mod truncated;
