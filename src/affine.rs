//! Affine maps of a draw's standard normals: the form of everything linear in a spectrum.

/// Affine map offset + gain . z from k standard normals z to m values.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Affine {
    /// Values at z = 0: m of them.
    pub(crate) offset: Vec<f64>,
    /// Change of each value per unit of each standard normal: k rows of m values.
    pub(crate) gain: Vec<Vec<f64>>,
}

impl Affine {
    /// Returns the products of the values with each row of `weights`.
    pub(crate) fn project(&self, weights: &[impl AsRef<[f64]>]) -> Affine {
        let product = |values: &[f64]| {
            let dot = |row: &[f64]| row.iter().zip(values).map(|(w, v)| w * v).sum::<f64>();
            weights.iter().map(|row| dot(row.as_ref())).collect()
        };
        Affine { offset: product(&self.offset), gain: self.gain.iter().map(|g| product(g)).collect() }
    }

    /// Returns the map of the value with this number alone.
    pub(crate) fn value(&self, number: usize) -> Affine {
        let gain = self.gain.iter().map(|gain| vec![gain[number]]).collect();
        Affine { offset: vec![self.offset[number]], gain }
    }

    /// Returns the map of the other inputs, where the first of them have these values.
    pub(crate) fn at(&self, first: &[f64]) -> Affine {
        let mut offset = self.offset.clone();
        for (gain, value) in self.gain.iter().zip(first) {
            offset.iter_mut().zip(gain).for_each(|(offset, gain)| *offset += gain * value);
        }
        Affine { offset, gain: self.gain[first.len()..].to_vec() }
    }

    /// Returns the map that is `value` whatever z is.
    pub(crate) fn constant(value: f64, components: usize) -> Affine {
        Affine { offset: vec![value], gain: vec![vec![0.0]; components] }
    }

    pub(crate) fn scaled(self, by: f64) -> Affine {
        let scaled = |values: Vec<f64>| values.into_iter().map(|v| v * by).collect();
        Affine { offset: scaled(self.offset), gain: self.gain.into_iter().map(scaled).collect() }
    }
}
