// (low, high) words of the 64-bit product a * b, from 16-bit halves: WGSL has no wide multiply.
fn mul_wide(a: u32, b: u32) -> vec2<u32> {
    let a0 = a & 0xFFFFu;
    let a1 = a >> 16u;
    let b0 = b & 0xFFFFu;
    let b1 = b >> 16u;
    let low = a0 * b0;
    let middle = a1 * b0 + (low >> 16u);
    let carry = a0 * b1 + (middle & 0xFFFFu);
    return vec2(a * b, a1 * b1 + (middle >> 16u) + (carry >> 16u));
}
