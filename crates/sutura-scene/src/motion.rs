//! Motion of grips and shapes through keys: where, how turned, and when.

use crate::curve::Piece;
use std::f64::consts::PI;
use sutura::Pose;
use sutura::glam::{DQuat, DVec3};
use sutura::math::{exp, log, rotation_arc};

/// How the way between keys is gone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ease {
    /// Quintic step: starts and ends each piece at rest, acceleration continuous; the top speed is 1.875 times the
    /// mean.
    Smooth,
    /// Constant speed between keys.
    Linear,
    /// One smooth curve through all keys, at rest only at the first and the last.
    Spline,
}

/// What `to` counts from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Relative {
    /// The world's origin and axes.
    World,
    /// Where the thing is when the move begins, world axes.
    Start,
    /// Where the grip was when it was taken, world axes.
    Taken,
    /// The frame of a shape when the move begins.
    Shape(usize),
}

/// Where a key goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// Stays where the key before was.
    Stay,
    To(DVec3),
    /// By a displacement from the key before.
    By(DVec3),
    /// Around an axis through a point, with an advance along it; `carry` turns the held piece along.
    Around {
        center: DVec3,
        axis: DVec3,
        angle: f64,
        advance: f64,
        carry: bool,
    },
}

/// How a key turns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Turning {
    Keep,
    /// By a rotation vector in world axes from the key before; more than a turn is allowed.
    By(DVec3),
    To(DQuat),
    /// Turns along the shortest way to point d3 along a direction.
    Point(DVec3),
}

/// When a key is reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum When {
    /// Seconds after the start of the move.
    At(f64),
    /// Seconds after the key before.
    After(f64),
    /// At this mean speed from the key before \[m/s\].
    Speed(f64),
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Key {
    pub goal: Goal,
    pub turning: Turning,
    pub when: When,
}

/// A move as the scene says it.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    pub keys: Vec<Key>,
    pub ease: Ease,
    pub relative: Relative,
    /// The held piece turns to point along the motion: its d3, or its -d3 where the thread trails the other way.
    pub along: Option<f64>,
}

/// A move from a known pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    pieces: Vec<MotionPiece>,
    start: Pose,
    /// Orientations at equal times over the whole move, when the piece points along it.
    along: Vec<DQuat>,
}

#[derive(Debug, Clone, PartialEq)]
struct MotionPiece {
    begin: f64,
    end: f64,
    path: Path,
    turn_from: DQuat,
    turn: Spin,
    ease: Ease,
}

#[derive(Debug, Clone, PartialEq)]
enum Path {
    Piece(Piece),
    /// Cubic with the velocities at its ends.
    Cubic {
        from: DVec3,
        to: DVec3,
        v0: DVec3,
        v1: DVec3,
    },
}

/// Rotation vector from the piece's start: `phi` reached at its end, with rates there for a spline.
#[derive(Debug, Clone, PartialEq)]
struct Spin {
    phi: DVec3,
    w0: DVec3,
    w1: DVec3,
}

/// 0 to 1 with no velocity and no acceleration at both ends.
pub fn quintic(s: f64) -> f64 {
    let s = s.clamp(0.0, 1.0);
    s * s * s * (10.0 + s * (6.0 * s - 15.0))
}

/// Cubic through `a` (velocity `v0`) and `b` (velocity `v1`) over `span` seconds.
fn cubic(a: DVec3, b: DVec3, v0: DVec3, v1: DVec3, span: f64, s: f64) -> DVec3 {
    let (s2, s3) = (s * s, s * s * s);
    a * (2.0 * s3 - 3.0 * s2 + 1.0) + b * (3.0 * s2 - 2.0 * s3) + (v0 * (s3 - 2.0 * s2 + s) + v1 * (s3 - s2)) * span
}

impl MotionPiece {
    fn pose(&self, t: f64) -> Pose {
        let span = self.end - self.begin;
        let s = if span > 0.0 { ((t - self.begin) / span).clamp(0.0, 1.0) } else { 1.0 };
        let eased = if self.ease == Ease::Smooth { quintic(s) } else { s };
        let position = match &self.path {
            Path::Piece(p) => p.at(eased),
            Path::Cubic { from, to, v0, v1 } => cubic(*from, *to, *v0, *v1, span, s),
        };
        let phi = if self.ease == Ease::Spline {
            cubic(DVec3::ZERO, self.turn.phi, self.turn.w0, self.turn.w1, span, s)
        } else {
            self.turn.phi * eased
        };
        Pose::new(position, (exp_any(phi) * self.turn_from).normalize())
    }
}

/// Rotation by a vector of any length (`exp` takes any angle; the name says that more than a turn is meant).
fn exp_any(phi: DVec3) -> DQuat {
    exp(phi)
}

impl Plan {
    /// The motion from a pose. `taken`: where the grip was taken; `shapes`: poses of the shapes now; `at`: how late in
    /// the phase the move begins is always 0.
    pub fn motion(&self, start: Pose, taken: Pose, shape: impl Fn(usize) -> Pose) -> Motion {
        let absolute = |p: DVec3| match self.relative {
            Relative::World => p,
            Relative::Start => start.position + p,
            Relative::Taken => taken.position + p,
            Relative::Shape(i) => shape(i).transform_point(p),
        };
        let mut pieces: Vec<MotionPiece> = Vec::new();
        let (mut at, mut here) = (0.0, start);
        for key in &self.keys {
            let path = match key.goal {
                Goal::Stay => Piece::Line { from: here.position, to: here.position },
                Goal::To(p) => Piece::Line { from: here.position, to: absolute(p) },
                Goal::By(d) => Piece::Line { from: here.position, to: here.position + d },
                Goal::Around { center, axis, angle, advance, .. } => {
                    Piece::Turn { start: here.position, center: absolute(center), axis, angle, advance }
                }
            };
            let carried = match key.goal {
                Goal::Around { axis, angle, carry: true, .. } => axis * angle,
                _ => DVec3::ZERO,
            };
            let phi = match key.turning {
                Turning::Keep => carried,
                Turning::By(phi) => phi,
                Turning::To(q) => log((q * here.orientation.conjugate()).normalize()),
                Turning::Point(d) => log(rotation_arc(here.orientation * DVec3::Z, d)),
            };
            let end = match key.when {
                When::At(t) => t.max(at),
                When::After(d) => at + d,
                When::Speed(v) => at + path.length() / v,
            };
            // Along a spline an arc becomes several keys, so that the spline stays on it (to 0.1 % of its radius at 15
            // degrees).
            let parts = match (&path, self.ease) {
                (Piece::Turn { angle, .. }, Ease::Spline) => {
                    ((angle.abs() / (PI / 12.0)).ceil() as usize).clamp(1, 1000)
                }
                _ => 1,
            };
            for k in 0..parts {
                let (s0, s1) = (k as f64 / parts as f64, (k + 1) as f64 / parts as f64);
                let part = if parts == 1 { path.clone() } else { Piece::Line { from: path.at(s0), to: path.at(s1) } };
                pieces.push(MotionPiece {
                    begin: at + (end - at) * s0,
                    end: at + (end - at) * s1,
                    path: Path::Piece(part),
                    turn_from: (exp_any(phi * s0) * here.orientation).normalize(),
                    turn: Spin { phi: phi * (1.0 / parts as f64), w0: DVec3::ZERO, w1: DVec3::ZERO },
                    ease: self.ease,
                });
            }
            here = Pose::new(path.at(1.0), (exp_any(phi) * here.orientation).normalize());
            at = end;
        }
        pieces.retain(|p| p.end > p.begin || self.keys.len() == 1);
        if self.ease == Ease::Spline {
            smooth_spline(&mut pieces);
        }
        let mut motion = Motion { pieces, start, along: Vec::new() };
        if let Some(sign) = self.along {
            motion.along = motion.orientations_along(sign);
        }
        motion
    }

    /// Seconds that the plan takes when every key says so; speeds count with the distance known from `by` and arcs
    /// only.
    pub fn least_duration(&self) -> f64 {
        self.keys.iter().fold(0.0, |at, key| match key.when {
            When::At(t) => t.max(at),
            When::After(d) => at + d,
            When::Speed(v) => match key.goal {
                Goal::By(d) => at + d.length() / v,
                _ => at,
            },
        })
    }
}

/// Velocities at inner keys: the mean of the neighboring pieces' mean velocities, each weighted with the other's
/// duration (Catmull-Rom for uneven times); at rest at both ends.
fn smooth_spline(pieces: &mut [MotionPiece]) {
    let mean = |p: &MotionPiece| {
        let span = p.end - p.begin;
        let Path::Piece(path) = &p.path else { return (DVec3::ZERO, DVec3::ZERO, span) };
        ((path.at(1.0) - path.at(0.0)) / span, p.turn.phi / span, span)
    };
    let means: Vec<_> = pieces.iter().map(mean).collect();
    let knot = |i: usize| {
        if i == 0 || i == means.len() {
            return (DVec3::ZERO, DVec3::ZERO);
        }
        let ((va, wa, da), (vb, wb, db)) = (means[i - 1], means[i]);
        ((va * db + vb * da) / (da + db), (wa * db + wb * da) / (da + db))
    };
    for (i, piece) in pieces.iter_mut().enumerate() {
        let ((v0, w0), (v1, w1)) = (knot(i), knot(i + 1));
        if let Path::Piece(path) = &piece.path {
            piece.path = Path::Cubic { from: path.at(0.0), to: path.at(1.0), v0, v1 };
        }
        (piece.turn.w0, piece.turn.w1) = (w0, w1);
    }
}

/// Orientations kept in a move whose piece points along it.
const ALONG_SAMPLES: usize = 512;

impl Motion {
    /// Seconds from its start to its last key.
    pub fn duration(&self) -> f64 {
        self.pieces.last().map_or(0.0, |p| p.end)
    }
    /// Pose at a time after its start.
    pub fn pose(&self, t: f64) -> Pose {
        let mut pose = match self.pieces.iter().find(|p| t < p.end).or(self.pieces.last()) {
            Some(piece) => piece.pose(t),
            None => self.start,
        };
        if let [first, .., last] = self.along.as_slice() {
            let s = t / self.duration() * (self.along.len() - 1) as f64;
            pose.orientation = match s {
                _ if s.is_nan() || s <= 0.0 => *first,
                _ if s >= (self.along.len() - 1) as f64 => *last,
                _ => {
                    let (a, b) = (self.along[s as usize], self.along[s as usize + 1]);
                    (exp(log((b * a.conjugate()).normalize()) * s.fract()) * a).normalize()
                }
            };
        }
        pose
    }
    /// The start orientation carried along the direction of motion without twist, the difference at the start closed
    /// smoothly over the first quarter of the move.
    fn orientations_along(&self, sign: f64) -> Vec<DQuat> {
        let duration = self.duration();
        let axis = DVec3::Z * sign;
        let mut q = self.start.orientation;
        let mut out = vec![q];
        for i in 1..=ALONG_SAMPLES {
            let t = duration * i as f64 / ALONG_SAMPLES as f64;
            let d = 0.5 * duration / ALONG_SAMPLES as f64;
            let direction = (self.position(t + d) - self.position(t - d)).normalize_or_zero();
            if direction != DVec3::ZERO {
                let remaining = log(rotation_arc(q * axis, direction));
                // While the start's difference is being closed, close the share that is due in this sample.
                let (s0, s1) = (4.0 * (i - 1) as f64 / ALONG_SAMPLES as f64, 4.0 * i as f64 / ALONG_SAMPLES as f64);
                let share = if s1 >= 1.0 { 1.0 } else { (quintic(s1) - quintic(s0)) / (1.0 - quintic(s0)) };
                q = (exp(remaining * share) * q).normalize();
            }
            out.push(q);
        }
        out
    }
    fn position(&self, t: f64) -> DVec3 {
        let piece = self.pieces.iter().find(|p| t < p.end).or(self.pieces.last());
        piece.map_or(self.start.position, |p| p.pose(t).position)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(ease: Ease, keys: Vec<Key>) -> Plan {
        Plan { keys, ease, relative: Relative::World, along: None }
    }
    fn to(x: f64, y: f64, z: f64, when: When) -> Key {
        Key { goal: Goal::To(DVec3::new(x, y, z)), turning: Turning::Keep, when }
    }
    fn run(plan: &Plan) -> Motion {
        plan.motion(Pose::IDENTITY, Pose::IDENTITY, |_| Pose::IDENTITY)
    }
    /// Velocity by central difference.
    fn velocity(m: &Motion, t: f64) -> DVec3 {
        (m.pose(t + 1e-6).position - m.pose(t - 1e-6).position) / 2e-6
    }

    #[test]
    fn smooth_rests_at_every_key_and_linear_does_not() {
        let keys = vec![to(1.0, 0.0, 0.0, When::After(1.0)), to(1.0, 2.0, 0.0, When::At(3.0))];
        let m = run(&plan(Ease::Smooth, keys.clone()));
        assert_eq!(m.duration(), 3.0);
        assert!((m.pose(1.0).position - DVec3::X).length() < 1e-15);
        for t in [0.0, 1.0, 3.0] {
            // The quintic leaves its keys as t^3, 1e-6 s away the mean velocity is 1e-11.
            assert!(velocity(&m, t).length() < 1e-9, "at rest at {t}");
        }
        assert!((velocity(&m, 0.5).length() - 1.875).abs() < 1e-6);
        assert!((velocity(&run(&plan(Ease::Linear, keys)), 1.5) - DVec3::Y).length() < 1e-8);
    }

    #[test]
    fn a_spline_passes_its_keys_without_stopping_or_jumping_in_velocity() {
        let m = run(&plan(
            Ease::Spline,
            vec![
                to(1.0, 0.0, 0.0, When::After(1.0)),
                to(1.0, 1.0, 0.0, When::After(0.5)),
                to(0.0, 1.0, 1.0, When::After(1.0)),
            ],
        ));
        assert!((m.pose(1.0).position - DVec3::X).length() < 1e-14);
        for t in [1.0, 1.5] {
            let (before, after) = (velocity(&m, t - 1e-5), velocity(&m, t + 1e-5));
            assert!((before - after).length() < 1e-3 && before.length() > 0.5, "at {t}: {before} {after}");
        }
        assert!(velocity(&m, 0.0).length() < 1e-4 && velocity(&m, 2.5).length() < 1e-4);
    }

    #[test]
    fn an_arc_stays_on_its_circle_in_every_mode() {
        for (ease, off) in [(Ease::Smooth, 1e-14), (Ease::Linear, 1e-14), (Ease::Spline, 1e-3)] {
            let start = Pose::at(DVec3::X);
            let around =
                Goal::Around { center: DVec3::ZERO, axis: DVec3::Z, angle: 3.0 * PI, advance: 0.3, carry: true };
            let m = plan(ease, vec![Key { goal: around, turning: Turning::Keep, when: When::After(2.0) }]).motion(
                start,
                start,
                |_| start,
            );
            for i in 0..=40 {
                let p = m.pose(f64::from(i) * 0.05).position;
                // A cubic through 15 degree steps leaves the circle by well under 0.1 % except in its end pieces.
                assert!((p.truncate().length() - 1.0).abs() <= off * 5.0, "{ease:?} {i} {}", p.truncate().length());
            }
            let end = m.pose(2.0);
            assert!((end.position - DVec3::new(-1.0, 0.0, 0.3)).length() < 1e-12);
            assert!((end.orientation * DVec3::X + DVec3::X).length() < 1e-12, "turned along");
        }
    }

    #[test]
    fn several_turns_are_several_turns() {
        let turn = Key { goal: Goal::Stay, turning: Turning::By(DVec3::X * 6.0 * PI), when: When::After(3.0) };
        let m = run(&plan(Ease::Linear, vec![turn]));
        let mut angle = 0.0;
        for i in 0..300 {
            let (a, b) = (m.pose(0.01 * f64::from(i)).orientation, m.pose(0.01 * f64::from(i + 1)).orientation);
            angle += log((b * a.conjugate()).normalize()).x;
        }
        assert!((angle - 6.0 * PI).abs() < 1e-10, "{angle}");
    }

    #[test]
    fn speed_gives_the_time() {
        let m =
            run(&plan(Ease::Smooth, vec![to(0.1, 0.0, 0.0, When::Speed(0.05)), to(0.1, 0.0, 0.0, When::Speed(0.05))]));
        assert!((m.duration() - 2.0).abs() < 1e-12);
        assert!(m.pose(5.0).position.distance(DVec3::X * 0.1) < 1e-15);
    }

    #[test]
    fn along_points_the_piece_along_the_motion() {
        let mut p = plan(
            Ease::Spline,
            vec![
                to(0.0, 0.0, 1.0, When::After(1.0)),
                to(1.0, 0.0, 1.0, When::After(1.0)),
                to(1.0, 1.0, 1.0, When::After(1.0)),
            ],
        );
        p.along = Some(-1.0);
        let m = run(&p);
        for t in [1.0, 1.5, 2.0, 2.5] {
            let d = velocity(&m, t).normalize();
            // 512 samples over 3 s with turns of some rad/s: a sample lags by about 0.006 rad.
            assert!((m.pose(t).orientation * -DVec3::Z).distance(d) < 0.03, "at {t}");
        }
        let step = log(m.pose(0.01).orientation * m.pose(0.0).orientation.conjugate()).length();
        assert!(step < 0.1, "no jump at the start: {step}");
    }

    #[test]
    fn relative_goals() {
        let start = Pose::at(DVec3::Y);
        let taken = Pose::at(DVec3::Z);
        let shape = Pose::new(DVec3::X, exp(DVec3::Z * PI));
        for (relative, wanted) in [
            (Relative::World, DVec3::X),
            (Relative::Start, DVec3::X + DVec3::Y),
            (Relative::Taken, DVec3::X + DVec3::Z),
            (Relative::Shape(0), DVec3::ZERO),
        ] {
            let p = Plan { relative, ..plan(Ease::Smooth, vec![to(1.0, 0.0, 0.0, When::After(1.0))]) };
            assert!(p.motion(start, taken, |_| shape).pose(1.0).position.distance(wanted) < 1e-12, "{relative:?}");
        }
    }
}
