//! Status of a draw: one word, as the shader writes it.

/// Status of a draw: the number of candidates up to and including the accepted one (0 where none was accepted), and
/// whether scaling took the spectrum to 1 or above. One word, as the shader writes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct DrawStatus(u32);

impl DrawStatus {
    pub(crate) const ABOVE_ONE: u32 = 1 << 31;

    pub(crate) fn accepted(attempts: u32, above_one: bool) -> DrawStatus {
        DrawStatus(attempts | if above_one { Self::ABOVE_ONE } else { 0 })
    }

    /// Status of a draw without an accepted candidate within the attempts allowed; all quantities are 0.
    pub(crate) const FAILED: DrawStatus = DrawStatus(0);

    /// The number of candidates up to and including the accepted one; 0 where none was.
    pub fn attempts(self) -> u32 {
        self.0 & !Self::ABOVE_ONE
    }

    /// Whether scaling to the target took a value of the spectrum to 1 or above (possible under
    /// [`Bounds::Base`](crate::Bounds::Base)).
    pub fn above_one(self) -> bool {
        self.0 & Self::ABOVE_ONE != 0
    }
}
