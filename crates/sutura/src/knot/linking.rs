//! Gauss integrals of polygons, exact but for round-off: each pair of straight segments contributes the signed solid
//! angle under which the one sees the other (Klenin and Langowski 2000).

use glam::DVec3;

/// Signed solid angle of a pair of segments, in [-2 pi, 2 pi]; zero for segments in a plane.
fn solid_angle(p1: DVec3, p2: DVec3, p3: DVec3, p4: DVec3) -> f64 {
    let (r13, r14, r23, r24) = (p3 - p1, p4 - p1, p3 - p2, p4 - p2);
    let faces = [r13.cross(r14), r14.cross(r24), r24.cross(r23), r23.cross(r13)];
    let mut n = [DVec3::ZERO; 4];
    for (n, face) in n.iter_mut().zip(faces) {
        let Some(unit) = face.try_normalize() else { return 0.0 };
        *n = unit;
    }
    let angle: f64 = (0..4).map(|i| libm::asin(n[i].dot(n[(i + 1) % 4]).clamp(-1.0, 1.0))).sum();
    let side = (p4 - p3).cross(p2 - p1).dot(r13);
    if side > 0.0 {
        angle
    } else if side < 0.0 {
        -angle
    } else {
        0.0
    }
}

/// Writhe of a polyline in turns: the mean over all views of the signed crossings. Positive for right-handed ones. With
/// `closed` the last point is joined to the first, and twist + writhe changes only where the thread passes through
/// itself (by 2).
pub fn writhe(points: &[DVec3], closed: bool) -> f64 {
    let n = points.len();
    let n_edges = if closed { n } else { n.saturating_sub(1) };
    let end = |i: usize| points[(i + 1) % n];
    let mut sum = 0.0;
    for i in 0..n_edges {
        // Neighbors lie in a plane and give nothing.
        let last = if closed && i == 0 { n_edges.saturating_sub(1) } else { n_edges };
        for j in i + 2..last {
            sum += solid_angle(points[i], end(i), points[j], end(j));
        }
    }
    sum / core::f64::consts::TAU
}

/// Linking number of two closed polygons (the last point is joined to the first): an integer up to round-off when they
/// do not touch.
pub fn gauss_linking(a: &[DVec3], b: &[DVec3]) -> f64 {
    let mut sum = 0.0;
    for i in 0..a.len() {
        for j in 0..b.len() {
            sum += solid_angle(a[i], a[(i + 1) % a.len()], b[j], b[(j + 1) % b.len()]);
        }
    }
    sum / (2.0 * core::f64::consts::TAU)
}
