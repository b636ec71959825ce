//! Bounds as half-spaces of the standard normals.

use crate::affine::Affine;

/// Largest accepted distance from the mean, in standard deviations of each component.
pub(crate) const REACH: f64 = 13.0;

/// One bound of one band: points with normal . z < room are accepted.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct HalfSpace {
    pub(crate) band: usize,
    /// Normal of length 1, or 0 where the bounded value does not depend on z.
    pub(crate) normal: Vec<f64>,
    /// Distance of the bound from the mean in standard deviations, unless the normal is 0.
    pub(crate) room: f64,
}

/// Bounds of physical spectra of a map: above 0 and, where it is so, below 1.
pub(crate) fn physical(spectrum: &Affine, is_below_one: bool) -> Vec<HalfSpace> {
    let mut half_spaces = Vec::new();
    for (band, &offset) in spectrum.offset.iter().enumerate() {
        let gains = || spectrum.gain.iter().map(|gain| gain[band]);
        half_spaces.push(HalfSpace::new(band, gains().map(|g| -g).collect(), offset));
        if is_below_one {
            half_spaces.push(HalfSpace::new(band, gains().collect(), 1.0 - offset));
        }
    }
    half_spaces
}

impl HalfSpace {
    pub(crate) fn new(band: usize, coefficients: Vec<f64>, room: f64) -> HalfSpace {
        let norm = coefficients.iter().map(|c| c * c).sum::<f64>().sqrt();
        let length = if norm > 0.0 { norm } else { 1.0 };
        let normal = coefficients.into_iter().map(|c| c / length).collect();
        HalfSpace { band, normal, room: room / length }
    }

    /// Whether all points or none are accepted.
    pub(crate) fn is_constant(&self) -> bool {
        self.normal.iter().all(|&c| c == 0.0)
    }

    /// Whether the half-space excludes any point within [`REACH`].
    pub(crate) fn cuts(&self) -> bool {
        let corner = REACH * (self.normal.len() as f64).sqrt();
        !self.is_constant() && self.room < corner + 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In 4 dimensions the corners of the region within reach are 26 standard deviations away.
    #[test]
    fn what_lies_beyond_the_corners_cuts_nothing() {
        let cuts = |room: f64| HalfSpace::new(0, vec![1.0; 4], 2.0 * room).cuts();
        assert_eq!([-5.0, 0.0, 25.9, 26.9, 27.1].map(cuts), [true, true, true, true, false]);
        assert!(!HalfSpace::new(0, vec![0.0; 4], -1.0).cuts());
    }
}
