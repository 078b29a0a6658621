// The tensors' boxes, drawn as lines over a picture. No twin; that of the struct is in src/player/boxes.rs.

struct Boxes {
    // From model space, relative to the field's origin, to clip space.
    clip_from_model: mat4x4<f32>,
    // [scale] half edges, and linear colors with opacity.
    halves: array<vec4<f32>, 16>,
    colors: array<vec4<f32>, 16>,
    // The width of the shell of a contracted scene, whose origin is that of model space; 0 if the scene is not contracted.
    shell: f32,
    // Straight parts of an edge.
    segments: u32,
}

@group(0) @binding(0) var<uniform> boxes: Boxes;

struct Line {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) color: vec4<f32>,
}

// The distance from the bounds of contracted space up to which boxes are drawn. Twin: `FROM_END` of boxes.rs.
const FROM_END = 1e-3;

// The point of model space whose image is `contracted`.
fn expanded(contracted: vec3<f32>) -> vec3<f32> {
    let size = abs(contracted);
    let norm = max(size.x, max(size.y, size.z));
    if boxes.shell == 0.0 || norm <= 1.0 {
        return contracted;
    }
    return contracted * (boxes.shell / max(1.0 + boxes.shell - norm, FROM_END) / norm);
}

@vertex
fn vertex(@builtin(vertex_index) index: u32, @location(0) center_and_scale: vec4<f32>) -> Line {
    // Twelve edges of some segments of two ends. An edge runs along axis edge / 4, at corner edge % 4 of the other two axes.
    let edge = index / (2u * boxes.segments);
    let axis = edge / 4u;
    let along = f32(index / 2u % boxes.segments + index % 2u) / f32(boxes.segments);
    let corner = vec3(along, f32(edge % 2u), f32(edge / 2u % 2u)) * 2.0 - 1.0;
    var turned = corner;
    if axis == 1u {
        turned = corner.zxy;
    } else if axis == 2u {
        turned = corner.yzx;
    }
    let s = u32(center_and_scale.w);
    let position = center_and_scale.xyz + turned * boxes.halves[s].xyz;
    return Line(boxes.clip_from_model * vec4(expanded(position), 1.0), boxes.colors[s]);
}

@fragment
fn fragment(line: Line) -> @location(0) vec4<f32> {
    return line.color;
}
