//! The error of samplers.

use crate::quantity::Quantity;

/// Error returned where something cannot be drawn on a device, or not in one dispatch.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum SamplerError {
    #[error(
        "a range of {count} draws, of which this device takes at most {largest} at once ({limit}): split the range"
    )]
    TooMany { count: u64, largest: u64, limit: &'static str },
    #[error(
        "{buffers} storage buffers, of which this device binds at most {largest} to a shader \
         (max_storage_buffers_per_shader_stage): ask for fewer quantities at once"
    )]
    TooManyBuffers { buffers: u32, largest: u32 },
    #[error("{0} bands, which are too many for one draw of a shader: draw on the CPU")]
    TooManyBands(usize),
    #[error(
        "draws of up to {attempts} candidates, of which dispatches that are recorded together try {largest} at most: \
         allow no more"
    )]
    TooManyAttempts { attempts: u32, largest: u32 },
    #[error(
        "{label} needs {bytes} bytes, and this device binds at most {largest} ({limit}): draw on the CPU"
    )]
    LargeTable { label: &'static str, bytes: u64, largest: u64, limit: &'static str },
    #[error(
        "{what} need {needed} bytes from offset {offset} on, and the buffer has {bytes} there: bind more of it"
    )]
    SmallBuffer { what: String, offset: u64, bytes: u64, needed: u64 },
    #[error("{what} begin at offset {offset} of a buffer, which must be a multiple of {alignment}")]
    Misaligned { what: String, offset: u64, alignment: u64 },
    #[error("the recipe does not ask for {0}, which a buffer was given for")]
    NotAsked(Quantity),
    #[error(
        "the recipe gives each draw {responses} responses, and there are none: prepare it with a buffer of them"
    )]
    NothingGiven { responses: usize },
    #[error("the device has no buffer for {label}: it was lost, or has no memory left")]
    NoBuffer { label: &'static str },
    #[error(
        "a range of {count} draws, where room for {prepared} was prepared: prepare the largest range first"
    )]
    NoRoom { count: u64, prepared: u64 },
}
