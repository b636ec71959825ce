//! CPU twin: src/random/philox.rs. `mul_wide` comes from the fragment of its name, in one of two forms.

// Philox4x32-10 (Salmon, Moraes, Dror & Shaw 2011): a pure function of (counter, key).

fn philox_round(c: vec4<u32>, key: vec2<u32>) -> vec4<u32> {
    let a = mul_wide(0xD2511F53u, c.x);
    let b = mul_wide(0xCD9E8D57u, c.z);
    return vec4(b.y ^ c.y ^ key.x, b.x, a.y ^ c.w ^ key.y, a.x);
}

//! Written out rather than looped: a loop would carry the bound checks that WGSL compilers add.
fn philox(counter: vec4<u32>, key: vec2<u32>) -> vec4<u32> {
    let weyl = vec2(0x9E3779B9u, 0xBB67AE85u);
    var c = philox_round(counter, key);
    c = philox_round(c, key + 1u * weyl);
    c = philox_round(c, key + 2u * weyl);
    c = philox_round(c, key + 3u * weyl);
    c = philox_round(c, key + 4u * weyl);
    c = philox_round(c, key + 5u * weyl);
    c = philox_round(c, key + 6u * weyl);
    c = philox_round(c, key + 7u * weyl);
    c = philox_round(c, key + 8u * weyl);
    return philox_round(c, key + 9u * weyl);
}
