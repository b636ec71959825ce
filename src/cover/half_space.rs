//! Bounds as half-spaces of the standard normals.

/// How far from the mean a draw may lie, in standard deviations of each component.
pub(crate) const REACH: f64 = 13.0;

/// One bound of one band: what is accepted has normal . z < room.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct HalfSpace {
    pub(crate) band: usize,
    /// Of length 1, or 0 where no z changes what is bounded.
    pub(crate) normal: Vec<f64>,
    /// In standard deviations, unless the normal is 0.
    pub(crate) room: f64,
}

impl HalfSpace {
    pub(crate) fn new(band: usize, coefficients: Vec<f64>, room: f64) -> HalfSpace {
        let norm = coefficients.iter().map(|c| c * c).sum::<f64>().sqrt();
        let length = if norm > 0.0 { norm } else { 1.0 };
        let normal = coefficients.into_iter().map(|c| c / length).collect();
        HalfSpace { band, normal, room: room / length }
    }

    /// Whether all points or none obey it.
    pub(crate) fn is_constant(&self) -> bool {
        self.normal.iter().all(|&c| c == 0.0)
    }

    /// Whether it cuts something off the points within [`REACH`].
    pub(crate) fn cuts(&self) -> bool {
        let corner = REACH * (self.normal.len() as f64).sqrt();
        !self.is_constant() && self.room < corner + 1.0
    }
}
