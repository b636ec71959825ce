//! Affine maps of the standard normals of a draw, which everything linear in a spectrum is.

/// offset + gain . z: m values of k standard normals.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Affine {
    /// The values at z = 0, m of them.
    pub(crate) offset: Vec<f64>,
    /// What each standard normal adds, k rows of m values.
    pub(crate) gain: Vec<Vec<f64>>,
}

impl Affine {
    /// The products of the values with each row of `weights`.
    pub(crate) fn project(&self, weights: &[impl AsRef<[f64]>]) -> Affine {
        let product = |values: &[f64]| {
            let dot = |row: &[f64]| row.iter().zip(values).map(|(w, v)| w * v).sum::<f64>();
            weights.iter().map(|row| dot(row.as_ref())).collect()
        };
        Affine { offset: product(&self.offset), gain: self.gain.iter().map(|g| product(g)).collect() }
    }

    /// One of the values alone.
    pub(crate) fn value(&self, number: usize) -> Affine {
        let gain = self.gain.iter().map(|gain| vec![gain[number]]).collect();
        Affine { offset: vec![self.offset[number]], gain }
    }

    /// Always `value`.
    pub(crate) fn constant(value: f64, components: usize) -> Affine {
        Affine { offset: vec![value], gain: vec![vec![0.0]; components] }
    }

    pub(crate) fn scaled(self, by: f64) -> Affine {
        let scaled = |values: Vec<f64>| values.into_iter().map(|v| v * by).collect();
        Affine { offset: scaled(self.offset), gain: self.gain.into_iter().map(scaled).collect() }
    }
}
