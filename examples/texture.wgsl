// A texel of an image becomes a spectrum where it is shaded: the colours are those of a texture, each a spectrum of its own.
// Before it comes the text of the recipe, whose names begin with `paint`.

@group(0) @binding(0) var colours: texture_2d<f32>;
// For each texel: X, Y and Z of its spectrum, and the number of candidates that it took.
@group(0) @binding(1) var<storage, read_write> shaded: array<vec4<f32>>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(colours);
    if any(id.xy >= size) {
        return;
    }
    let colour = textureLoad(colours, id.xy, 0).xyz;
    // The place and the row of the texel are its index, as they are in a data set of the image.
    let paint = paint_draw_given(vec2(SEED, 0u), id.xy, colour);
    shaded[id.y * size.x + id.x] = vec4(paint_xyz(paint), f32(paint.attempts));
}
