// The tensors' boxes, drawn as lines over a picture. No twin; that of the struct is in src/player/boxes.rs.

struct Boxes {
    // From model space, relative to the field's origin, to clip space.
    clip_from_model: mat4x4<f32>,
    // [scale] half edges, and linear colors with opacity.
    halves: array<vec4<f32>, 16>,
    colors: array<vec4<f32>, 16>,
}

@group(0) @binding(0) var<uniform> boxes: Boxes;

struct Line {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) color: vec4<f32>,
}

@vertex
fn vertex(@builtin(vertex_index) index: u32, @location(0) center_and_scale: vec4<f32>) -> Line {
    // Twelve edges of two ends. An edge runs along axis edge / 4, at corner edge % 4 of the other two axes.
    let edge = index / 2u;
    let axis = edge / 4u;
    let corner = vec3(f32(index % 2u), f32(edge % 2u), f32(edge / 2u % 2u)) * 2.0 - 1.0;
    var turned = corner;
    if axis == 1u {
        turned = corner.zxy;
    } else if axis == 2u {
        turned = corner.yzx;
    }
    let s = u32(center_and_scale.w);
    let position = center_and_scale.xyz + turned * boxes.halves[s].xyz;
    return Line(boxes.clip_from_model * vec4(position, 1.0), boxes.colors[s]);
}

@fragment
fn fragment(line: Line) -> @location(0) vec4<f32> {
    return line.color;
}
