// The standard normals of an attempt.
fn normals(key: vec2<u32>, index: vec2<u32>, stream: u32, attempt: u32) -> Normals {
    var z: Normals;
    for (var block = 0u; block < BLOCKS; block++) {
        let words = philox(vec4(index, attempt, stream | block), key);
        let a = normal_pair(words.x, words.y);
        let b = normal_pair(words.z, words.w);
        z[4u * block] = a.x;
        z[4u * block + 1u] = a.y;
        z[4u * block + 2u] = b.x;
        z[4u * block + 3u] = b.y;
    }
    return z;
}
