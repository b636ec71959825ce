//! Self-test of a device: a shader that counts where its f32 operations differ from exact ones.

use serde::Serialize;

use super::WORKGROUP;
use super::guards::rounding;

const SELF_TEST: &str = include_str!("../../shaders/self_test.wgsl");

/// Number of cases: each is a thread.
pub(crate) const CASES: u32 = 1 << 18;

/// Trait of a device's f32 arithmetic that the self-test counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum ArithmeticTrait {
    /// Square roots that are not the nearest value.
    LooseRoots,
    /// Quotients that are not the nearest value.
    LooseQuotients,
    /// Signed integers that are not converted to the nearest value.
    LooseConversions,
    /// Unsigned integers that are not converted to the nearest value.
    LooseUnsignedConversions,
    /// Products that are fused into sums.
    Fusion,
    /// Sums of sums in another order.
    RearrangedSums,
    /// Products of products in another order.
    RearrangedProducts,
    /// Products that are distributed over sums, or factored out of them.
    Distribution,
    /// Values below the normal range that are taken for 0.
    Flushing,
    /// Sums that are not rounded to nearest, ties to even: no form of text has the draws of the CPU then.
    OtherSums,
    /// Products that are not rounded to nearest, ties to even: no form of text has the draws of the CPU then.
    OtherProducts,
}

impl ArithmeticTrait {
    /// All traits, in the order of the shader's counters.
    pub const ALL: &[ArithmeticTrait] = &[
        ArithmeticTrait::LooseRoots,
        ArithmeticTrait::LooseQuotients,
        ArithmeticTrait::LooseConversions,
        ArithmeticTrait::LooseUnsignedConversions,
        ArithmeticTrait::Fusion,
        ArithmeticTrait::RearrangedSums,
        ArithmeticTrait::RearrangedProducts,
        ArithmeticTrait::Distribution,
        ArithmeticTrait::Flushing,
        ArithmeticTrait::OtherSums,
        ArithmeticTrait::OtherProducts,
    ];

    /// Name of the trait, in words.
    pub fn name(self) -> &'static str {
        match self {
            ArithmeticTrait::LooseRoots => "loose roots",
            ArithmeticTrait::LooseQuotients => "loose quotients",
            ArithmeticTrait::LooseConversions => "loose conversions",
            ArithmeticTrait::LooseUnsignedConversions => "loose unsigned conversions",
            ArithmeticTrait::Fusion => "fusion",
            ArithmeticTrait::RearrangedSums => "rearranged sums",
            ArithmeticTrait::RearrangedProducts => "rearranged products",
            ArithmeticTrait::Distribution => "distribution",
            ArithmeticTrait::Flushing => "flushing",
            ArithmeticTrait::OtherSums => "other sums",
            ArithmeticTrait::OtherProducts => "other products",
        }
    }
}

/// Text of the self-test: a uniform of zeros at binding 0, and counters at binding 1, one for each trait.
pub(crate) fn self_test() -> String {
    let test = SELF_TEST.replace("COUNTERS", &ArithmeticTrait::ALL.len().to_string());
    let test = test.replace("WORKGROUP", &WORKGROUP.to_string());
    let notes = |line: &&str| !line.starts_with("//!");
    rounding("zero.x") + &test.lines().filter(notes).map(|line| line.to_owned() + "\n").collect::<String>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_trait_has_its_counter() {
        let text = self_test();
        for counter in 0..ArithmeticTrait::ALL.len() {
            assert_eq!(text.matches(&format!("count({counter}u, ")).count(), 1, "{counter}");
        }
        assert_eq!(text.matches("    count(").count(), ArithmeticTrait::ALL.len());
        let module =
            naga::front::wgsl::parse_str(&text).unwrap_or_else(|e| panic!("{}", e.emit_to_string(&text)));
        let flags = naga::valid::ValidationFlags::all();
        naga::valid::Validator::new(flags, naga::valid::Capabilities::empty()).validate(&module).unwrap();
    }
}
