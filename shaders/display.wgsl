// Shows a picture on a surface, scaled to its rectangle, as one of several views. Twin: src/desktop/memory.rs;
// that of the struct is in src/player/screen.rs.

struct Display {
    // The picture, in pixels.
    picture: vec2<u32>,
    // Its rectangle on the surface, in the surface's pixels.
    corner: vec2<f32>,
    size: vec2<f32>,
    // 0 color, 1 depth, 2 opacity, 3 normals, 4 samples.
    view: u32,
    // 1 if the surface expects linear light.
    is_linear: u32,
    // The scene's background, on which pixels are composited, and the background to show.
    scene_background: vec3<f32>,
    // The photograph's opacity.
    photograph_share: f32,
    background: vec3<f32>,
    // The number of samples that is shown as white.
    most_samples: f32,
    // The nearest and the farthest depth.
    depths: vec2<f32>,
    // Or the depth of medium gray, if all depths up to infinity are shown; else 0.
    depth_scale: f32,
    padding: f32,
    // The photograph's corner and size, relative to the picture's rectangle.
    photograph: vec4<f32>,
    // The camera's axes.
    right: vec3<f32>,
    padding1: f32,
    up: vec3<f32>,
    padding2: f32,
    back: vec3<f32>,
    padding3: f32,
}

@group(0) @binding(0) var<uniform> display: Display;
@group(0) @binding(1) var<storage, read> picture: array<vec4<f32>>;
@group(0) @binding(2) var photograph: texture_2d<f32>;
@group(0) @binding(3) var smooth_sampler: sampler;

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    // One triangle that covers the surface.
    return vec4(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

// The index of the pixel at `column` and `row`, clamped to the picture.
fn texel(column: i32, row: i32) -> u32 {
    let last = vec2<i32>(display.picture) - 1;
    let at = clamp(vec2(column, row), vec2(0), last);
    return u32(at.y) * display.picture.x + u32(at.x);
}

// The color at `at`, in pixels from the corner, on the background to show.
fn color_at(at: vec2<f32>) -> vec3<f32> {
    let corner = floor(at - 0.5);
    let part = at - 0.5 - corner;
    let c = vec2<i32>(corner);
    let above = mix(picture[2u * texel(c.x, c.y)], picture[2u * texel(c.x + 1, c.y)], part.x);
    let below = mix(picture[2u * texel(c.x, c.y + 1)], picture[2u * texel(c.x + 1, c.y + 1)], part.x);
    let color = mix(above, below, part.y);
    return color.xyz + (1.0 - color.w) * (display.background - display.scene_background);
}

// The direction of a code by `coded` in normals.wgsl.
fn normal_of(code: f32) -> vec3<f32> {
    let steps = u32(code) - 1u;
    let flat = vec2(f32(steps / 2048u), f32(steps % 2048u)) / 2047.0 * 2.0 - 1.0;
    let z = 1.0 - abs(flat.x) - abs(flat.y);
    let signs = select(vec2(-1.0), vec2(1.0), flat >= vec2(0.0));
    return normalize(vec3(select(flat, (1.0 - abs(flat.yx)) * signs, z < 0.0), z));
}

// A color map from dark blue through red to white.
fn heat(share: f32) -> vec3<f32> {
    let x = clamp(share, 0.0, 1.0);
    return clamp(vec3(2.2 * x, 2.4 * x - 1.0, 0.35 + 1.6 * x * (1.0 - 2.0 * x) + max(4.0 * x - 3.0, 0.0)), vec3(0.0), vec3(1.0));
}

// sRGB to linear light.
fn linear_of(color: vec3<f32>) -> vec3<f32> {
    let c = clamp(color, vec3(0.0), vec3(1.0));
    return select(pow((c + 0.055) / 1.055, vec3(2.4)), c / 12.92, c <= vec3(0.04045));
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let share = (position.xy - display.corner) / display.size;
    let at = share * vec2<f32>(display.picture);
    let first = 2u * texel(i32(floor(at.x)), i32(floor(at.y)));
    var color = vec3(0.0);
    switch display.view {
        case 1u: {
            let depth = picture[first + 1u].x;
            let between = (display.depths.y - depth) / max(display.depths.y - display.depths.x, 1e-6);
            let scale = display.depth_scale;
            let nearness = select(between, scale / max(scale + depth, 1e-6), scale > 0.0);
            color = select(vec3(0.0), vec3(mix(0.08, 1.0, clamp(nearness, 0.0, 1.0))), depth > 0.0) * picture[first].w;
        }
        case 2u: {
            color = vec3(picture[first].w);
        }
        case 3u: {
            let code = picture[first + 1u].w;
            if code >= 1.0 {
                let normal = normal_of(code);
                let seen = vec3(dot(normal, display.right), dot(normal, display.up), dot(normal, display.back));
                color = 0.5 + 0.5 * seen;
            }
        }
        case 4u: {
            color = heat(picture[first + 1u].y / max(display.most_samples, 1.0));
        }
        default: {
            color = color_at(at);
        }
    }
    let in_photograph = (share - display.photograph.xy) / display.photograph.zw;
    let seen = textureSampleLevel(photograph, smooth_sampler, in_photograph, 0.0).xyz;
    let is_seen = all(in_photograph >= vec2(0.0)) && all(in_photograph <= vec2(1.0));
    color = mix(color, seen, select(0.0, display.photograph_share, is_seen));
    if display.is_linear == 1u {
        color = linear_of(color);
    }
    return vec4(color, 1.0);
}
