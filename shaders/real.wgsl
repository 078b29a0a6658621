// Functions that are accurate for all arguments, which WGSL does not require of its own. Twin: src/field/real.rs.

// ln(1 + exp(x))
fn softplus(x: f32) -> f32 {
    let e = exp(-min(abs(x), 80.0));
    // For small e, ln(1 + e) by its series, because 1 + e loses the digits of e.
    let above = select(log(1.0 + e), e * (1.0 - e * (0.5 - e / 3.0)), e < 0.01);
    return max(x, 0.0) + above;
}

// 1 − exp(−x) for x ≥ 0.
fn opacity_of(x: f32) -> f32 {
    // 1 − exp(−x) loses the digits of a small x.
    let series = x * (1.0 - x * (0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x / 120.0))));
    return select(1.0 - exp(-min(x, 80.0)), series, x < 0.1);
}

fn sigmoid(x: vec3<f32>) -> vec3<f32> {
    // Without the clamp exp overflows, of which WGSL promises nothing.
    return 1.0 / (1.0 + exp(-clamp(x, vec3(-80.0), vec3(80.0))));
}

struct SineCosine {
    sine: vec4<f32>,
    cosine: vec4<f32>,
}

// Sine and cosine by reduction to quarter turns and polynomials on ±π/4.
fn sine_cosine(x: vec4<f32>) -> SineCosine {
    let turns = round(x * 0.63661977);
    // π/2 is subtracted in three parts, the first two of few bits. The remainder of a very large x is meaningless; the
    // clamp keeps it bounded.
    let r = clamp(((x - turns * 1.5703125) - turns * 4.837512969970703e-4) - turns * 7.549789948768648e-8, vec4(-1.0), vec4(1.0));
    let s = r * r;
    let sine = r + r * s * (-0.16666655 + s * (8.3321609e-3 - s * 1.9515296e-4));
    let cosine = 1.0 - 0.5 * s + s * s * (4.1666646e-2 + s * (-1.3887316e-3 + s * 2.4433157e-5));
    let quarter = vec4<i32>(turns) & vec4(3);
    let swapped = (quarter & vec4(1)) == vec4(1);
    let sine_sign = select(vec4(1.0), vec4(-1.0), quarter >= vec4(2));
    let cosine_sign = select(vec4(1.0), vec4(-1.0), (quarter == vec4(1)) | (quarter == vec4(2)));
    return SineCosine(sine_sign * select(sine, cosine, swapped), cosine_sign * select(cosine, sine, swapped));
}
