//! Which adapter draws, and who said so: variables of the environment are named where they hide one.

mod program;

use std::process::Command;

use program::PROGRAM;

/// Exit code of a run with a variable, and what it says.
fn with(variable: &str, value: &str, arguments: &str) -> (Option<i32>, String) {
    let folder = tempfile::tempdir().unwrap();
    let mut command = Command::new(PROGRAM);
    command.env_remove("WGPU_ADAPTER_NAME").env_remove("WGPU_BACKEND").env(variable, value);
    let output = command.args(arguments.split_whitespace()).current_dir(folder.path()).output().unwrap();
    (output.status.code(), String::from_utf8([output.stdout, output.stderr].concat()).unwrap())
}

const ON_GPU: &str = "sample granada -n 1 --engine gpu -o y.npy";

#[test]
fn a_backend_that_hides_all_adapters_is_named() {
    // OpenGL is not built in, and Metal is on other systems.
    let hidden = if cfg!(target_os = "macos") { "vulkan" } else { "metal" };
    for backend in ["gl", hidden] {
        let (code, said) = with("WGPU_BACKEND", backend, ON_GPU);
        assert_eq!(code, Some(3), "{said}");
        assert!(said.contains(&format!("the variable WGPU_BACKEND is \"{backend}\"")), "{said}");
        assert!(!said.contains("install"), "{said}");
        let (code, said) = with("WGPU_BACKEND", backend, "sample granada -n 1 --adapter 0 -o y.npy");
        assert_eq!(code, Some(3), "{said}");
        assert!(said.contains("WGPU_BACKEND"), "{said}");
        let (code, said) = with("WGPU_BACKEND", backend, "adapters");
        assert_eq!(code, Some(0), "{said}");
        assert!(said.contains("the variable WGPU_BACKEND is") && !said.contains("install"), "{said}");
        let (code, said) = with("WGPU_BACKEND", backend, "sample granada -n 1 -o y.npy");
        assert_eq!(code, Some(0), "{said}");
        assert!(said.contains(&format!("with WGPU_BACKEND={backend}")), "{said}");
    }
}

#[test]
fn a_backend_that_there_is_not_is_named() {
    for value in ["vulcan", "vulkan,glx"] {
        let (code, said) = with("WGPU_BACKEND", value, ON_GPU);
        assert_eq!(code, Some(3), "{said}");
        assert!(
            said.contains(&format!("WGPU_BACKEND is \"{value}\"")) && said.contains("vulkan, metal"),
            "{said}"
        );
    }
    assert_eq!(with("WGPU_BACKEND", "vulcan", "adapters").0, Some(3));
}

#[test]
fn an_empty_variable_is_none() {
    for variable in ["WGPU_BACKEND", "WGPU_ADAPTER_NAME"] {
        for value in ["", " "] {
            let (code, said) = with(variable, value, ON_GPU);
            assert_eq!(code, Some(0), "{variable}: {said}");
        }
    }
}

#[test]
fn an_adapter_that_a_variable_asks_for_is_said_to_be_so() {
    let (code, said) = with("WGPU_ADAPTER_NAME", "nonesuch", ON_GPU);
    assert_eq!(code, Some(3), "{said}");
    assert!(said.contains("no adapter \"nonesuch\", as the variable WGPU_ADAPTER_NAME asks for"), "{said}");
    let (_, said) = with("WGPU_ADAPTER_NAME", "", "sample granada -n 1 --adapter nonesuch -o y.npy");
    assert!(said.contains("no adapter \"nonesuch\"; there"), "{said}");
}
