//! A texture of braided thread.

/// Side of the square picture in pixels.
const SIDE: usize = 64;

/// Strands that wind around the thread each way.
const STRANDS: f64 = 4.0;

/// A braid as a gray PNG that repeats both ways: strands at 45 degrees to the right over and under strands to the left,
/// one of them dark, so that it is seen how the thread is twisted.
pub fn braid() -> Vec<u8> {
    let mut pixels = Vec::with_capacity(SIDE * SIDE);
    for row in 0..SIDE {
        for column in 0..SIDE {
            let (u, v) = ((column as f64 + 0.5) / SIDE as f64, (row as f64 + 0.5) / SIDE as f64);
            let (right, left) = (STRANDS * (u + v), STRANDS * (u - v));
            let over = (right.floor() + left.floor()).rem_euclid(2.0) < 1.0;
            // Across the strand on top, from 0 to 1: a ridge.
            let across = if over { left } else { right }.rem_euclid(1.0);
            let ridge = 4.0 * across * (1.0 - across);
            let dark = over && left.floor().rem_euclid(STRANDS) < 1.0;
            let shade = (0.55 + 0.45 * ridge) * if dark { 0.45 } else { 1.0 };
            pixels.push((255.0 * shade).round() as u8);
        }
    }
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, SIDE as u32, SIDE as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    // Memory does not run full, and the picture is of the size that was said.
    encoder.write_header().and_then(|mut writer| writer.write_image_data(&pixels)).expect("a picture in memory");
    bytes
}
