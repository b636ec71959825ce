//! Structures that Rust writes and a shader reads: whether both lay them out alike.

use naga::TypeInner;
use naga::front::wgsl::parse_str;

/// Panics unless the structure `name` of a shader has these members at these offsets, and is no larger than the `size`
/// bytes that Rust writes.
pub(crate) fn assert_layout(text: &str, name: &str, members: &[(&str, usize)], size: usize) {
    let module = parse_str(text).unwrap_or_else(|e| panic!("{}", e.emit_to_string(text)));
    let mut types = module.types.iter().map(|(_, ty)| ty);
    let ty = types.find(|ty| ty.name.as_deref() == Some(name)).expect("the shader has the structure");
    let TypeInner::Struct { members: found, span } = &ty.inner else { panic!("{name} is no structure") };
    let found: Vec<_> =
        found.iter().map(|m| (m.name.as_deref().unwrap_or_default(), m.offset as usize)).collect();
    assert_eq!(found, members, "{name}");
    assert!(*span as usize <= size, "{name} has {span} bytes in the shader and {size} in Rust");
}

/// The named fields of a structure, each with its offset.
macro_rules! offsets {
    ($structure:ty: $($field:ident),+) => {
        [$((stringify!($field), std::mem::offset_of!($structure, $field))),+]
    };
}
pub(crate) use offsets;

#[test]
#[should_panic(expected = "assertion `left == right` failed: Pair")]
fn another_order_is_noticed() {
    assert_layout("struct Pair { b: u32, a: vec2<u32> }", "Pair", &[("a", 0), ("b", 8)], 12);
}

#[test]
#[should_panic(expected = "16 bytes in the shader and 12 in Rust")]
fn padding_that_is_missing_is_noticed() {
    assert_layout("struct Pair { a: vec2<u32>, b: u32 }", "Pair", &[("a", 0), ("b", 8)], 12);
}
