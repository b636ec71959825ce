//! Examination of the project itself: statistics, stiff and extreme cases, costs, and the report that shows them.
//!
//! Not for users of the library: nothing here is kept stable.

pub mod adapter;
pub mod comparison;
pub mod costs;
pub mod plot;
pub mod report;
pub mod statistics;
pub mod stress;
