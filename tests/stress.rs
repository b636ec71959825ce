//! Stiff and extreme cases, on the CPU and on the best adapter: each must have its one right answer, and soon.
//!
//! Without an adapter the second test fails; `WGPU_ADAPTER_NAME` picks one.

use spectroll::evaluation::stress::cases;
use spectroll::{Engine, EngineChoice};

/// What "does not hang" means, seconds: a hundred times what the slowest case takes, but for compiling long shaders.
const SOON: f64 = 60.0;

fn assert_right_answers(choice: &EngineChoice) {
    let engine = Engine::new(choice).unwrap_or_else(|e| panic!("these cases need an engine: {e}"));
    let outcomes: Vec<_> = cases().map(|case| case.run(&engine)).collect();
    println!("on {engine}:");
    for o in &outcomes {
        let verdict = if o.passed { "ok" } else { "WRONG" };
        let error = o.error.zip(o.bound).map_or(String::new(), |(e, b)| format!(" [{e:.1e} of {b:.0e}]"));
        println!("{verdict:5} {:6.2} s  {}: {}{error}", o.seconds, o.name, o.result);
    }
    let wrong: Vec<_> = outcomes.iter().filter(|o| !o.passed || o.seconds > SOON).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn every_case_has_its_right_answer_on_the_cpu() {
    assert_right_answers(&EngineChoice::Cpu);
}

#[test]
fn every_case_has_its_right_answer_on_an_adapter() {
    assert_right_answers(&EngineChoice::Gpu);
}
