//! Models as files.

use std::path::Path;

use crate::model::Model;
use crate::output::{IfExists, OutputError, write_file};

impl Model {
    /// Writes a model file, which appears under its name only when it is complete. [`Model::load`] reads the same model,
    /// to the last bit.
    pub fn save(&self, path: impl AsRef<Path>, if_exists: IfExists) -> Result<(), OutputError> {
        write_file(path.as_ref(), if_exists, (self.to_json() + "\n").as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_saved_model_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("surfaces.json");
        let model = Model::builtin("munsell-vrhel").unwrap();
        model.save(&path, IfExists::Refuse).unwrap();
        assert_eq!(Model::load(&path).unwrap(), model);
        assert!(matches!(model.save(&path, IfExists::Refuse), Err(OutputError::Exists { .. })));
    }
}
