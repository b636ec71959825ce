fn uniform_of(word: u32) -> f32 {
    return (f32(word) + 0.5f) * 2.3283064e-10f;
}
