// The color behind the scene by direction (spec 4.11). Twin: src/field/sky.rs.

// The color in `direction`: coefficients times polynomials. The factors of the basis are in the coefficients.
fn sky_color(direction: vec3<f32>) -> vec3<f32> {
    let x = direction.x;
    let y = direction.y;
    let z = direction.z;
    let x2 = x * x;
    let y2 = y * y;
    let z2 = z * z;
    let difference = x2 - y2;
    let product = x * y;
    let sine3 = y * (3.0 * x2 - y2);
    let cosine3 = x * (x2 - 3.0 * y2);
    let polynomials = array<f32, 25>(
        1.0,
        y,
        z,
        x,
        product,
        y * z,
        3.0 * z2 - 1.0,
        x * z,
        difference,
        sine3,
        product * z,
        y * (5.0 * z2 - 1.0),
        z * (5.0 * z2 - 3.0),
        x * (5.0 * z2 - 1.0),
        z * difference,
        cosine3,
        product * difference,
        z * sine3,
        product * (7.0 * z2 - 1.0),
        y * z * (7.0 * z2 - 3.0),
        z2 * (35.0 * z2 - 30.0) + 3.0,
        x * z * (7.0 * z2 - 3.0),
        difference * (7.0 * z2 - 1.0),
        z * cosine3,
        difference * difference - 4.0 * product * product,
    );
    var sum = vec3(0.0);
    for (var k = 0u; k < SKY_TERMS; k += 1u) {
        sum += scene.sky[k].xyz * polynomials[k];
    }
    return sigmoid(sum);
}
