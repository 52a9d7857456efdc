//! Draws an overhand knot tight and lets it go; prints what happened. Arguments as `key=value`: see `Options`.

use sutura::audit::Audit;
use sutura::glam::DVec3;
use sutura::knot::{Ends, recognize};
use sutura::{Friction, GripSpec, Hold, Material, Place, Pose, RodSpec, Settings, World};

struct Options {
    r: f64,
    e: f64,
    speed: f64,
    mu: f64,
    l: f64,
    sub: f64,
    verbose: bool,
    release: f64,
    tau: f64,
}

/// A loose open trefoil through `n + 1` points, tails along x, total length `length`.
fn overhand(length: f64, n: usize) -> Vec<DVec3> {
    // Polynomial trefoil (Shastri): (t^3 - 3 t, t^4 - 4 t^2, t^5 / 5 - 2 t), tails straightened.
    let fine: Vec<DVec3> = (0..=4000)
        .map(|i| {
            let t = -2.05 + 4.1 * f64::from(i) / 4000.0;
            DVec3::new(t * t * t - 3.0 * t, t.powi(4) - 4.0 * t * t, 0.55 * (t.powi(5) / 5.0 - 2.0 * t))
        })
        .collect();
    let knot: f64 = fine.windows(2).map(|w| (w[1] - w[0]).length()).sum();
    // The knotted part takes 45 % of the thread.
    let scale = 0.45 * length / knot;
    let tail = 0.275 * length;
    let (first, last) = (fine[0] * scale, fine[4000] * scale);
    let (d0, d1) = ((fine[0] - fine[1]).normalize(), (fine[4000] - fine[3999]).normalize());
    let mut points = vec![];
    for i in 0..200 {
        points.push(first + d0 * tail * (1.0 - f64::from(i) / 200.0));
    }
    points.extend(fine.iter().map(|p| *p * scale));
    for i in 1..=200 {
        points.push(last + d1 * tail * f64::from(i) / 200.0);
    }
    let mut arc = vec![0.0];
    for w in points.windows(2) {
        arc.push(arc[arc.len() - 1] + (w[1] - w[0]).length());
    }
    let total = arc[arc.len() - 1];
    (0..=n)
        .map(|i| {
            let s = total * i as f64 / n as f64;
            let k = arc.partition_point(|a| *a < s).clamp(1, arc.len() - 1);
            points[k - 1].lerp(points[k], (s - arc[k - 1]) / (arc[k] - arc[k - 1]))
        })
        .collect()
}

fn main() {
    let mut o = Options { r: 0.25e-3, e: 2e9, speed: 0.05, mu: 0.3, l: 2.0, sub: 240.0, verbose: false, release: 0.2, tau: 0.01 };
    for arg in std::env::args().skip(1) {
        let (k, v) = arg.split_once('=').expect("key=value");
        let x: f64 = v.parse().unwrap_or(0.0);
        match k {
            "r" => o.r = x,
            "e" => o.e = x,
            "speed" => o.speed = x,
            "mu" => o.mu = x,
            "l" => o.l = x,
            "sub" => o.sub = x,
            "v" => o.verbose = x != 0.0,
            "release" => o.release = x,
            "tau" => o.tau = x,
            _ => panic!("unknown {k}"),
        }
    }
    let length = 600.0 * o.r;
    let n = (length / (o.l * 2.0 * o.r)).round() as usize;
    let mut material = Material::elastic(o.e, 1150.0);
    material.bend_damping = o.tau;
    let settings = Settings {
        gravity: DVec3::ZERO,
        substep: 1.0 / o.sub,
        friction: Friction::coulomb(o.mu),
        linear_damping: 0.9,
        angular_damping: 0.9,
        ..Settings::default()
    };
    let mut world = World::new(settings).unwrap();
    let rod = world.insert_rod(&RodSpec::new(overhand(length, n), o.r, material)).unwrap();
    let left = world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
    let right = world.insert_grip(&GripSpec::at_once(rod, Place::End, Hold::Clamp)).unwrap();
    let ea = world.rod(rod).unwrap().axial_stiffness();
    let mut audit = Audit::new();
    let dt = 1.0 / 60.0;
    let (mut l, mut r) = (world.grip_pose(left).unwrap(), world.grip_pose(right).unwrap());
    let mut times = vec![];
    let (mut subs, mut rejected, mut newton, mut incidents) = (0, 0, 0, 0);
    let mut released_at = None;
    let mut end_reason = "time";
    let limit = length / o.speed;
    let mut held = true;
    for frame in 0..100_000 {
        if held {
            // Turn toward the axis between the ends while drawing apart.
            let axis = (r.position - l.position).normalize();
            let turn = |p: &Pose, to: DVec3| {
                Pose::new(
                    p.position,
                    (sutura::math::rotation_arc(p.orientation * DVec3::Z, (p.orientation * DVec3::Z).lerp(to, 0.05).normalize()) * p.orientation).normalize(),
                )
            };
            l = turn(&l, axis);
            r = turn(&r, axis);
            l.position -= axis * (o.speed * dt);
            r.position += axis * (o.speed * dt);
            world.set_grip_pose(left, l).unwrap();
            world.set_grip_pose(right, r).unwrap();
        }
        let t0 = cpu_time::ThreadTime::now();
        let mut audit_time = 0.0;
        let report = world.step_with(dt, &mut |view| {
            let t = cpu_time::ThreadTime::now();
            audit.observe(view);
            audit_time += t.elapsed().as_secs_f64();
        });
        times.push((t0.elapsed().as_secs_f64() - audit_time) * 1e3);
        subs += report.substeps;
        rejected += report.rejected;
        newton += report.newton_iterations;
        incidents += report.incidents.len();
        let view = world.rod(rod).unwrap();
        let tension = view.max_tension();
        if o.verbose && frame % 10 == 0 {
            eprintln!(
                "t {:.3} tension {tension:.4} ms {:.2} sub {} rej {} newton {} contacts {} clear {:?} incidents {:?}",
                report.time,
                times[times.len() - 1],
                report.substeps,
                report.rejected,
                report.newton_iterations,
                report.contacts,
                report.thread_clearance,
                report.incidents.first()
            );
        }
        if held {
            let span = (r.position - l.position).length();
            let reason = if tension > 0.01 * ea {
                "tension"
            } else if span > length - 50.0 * o.r {
                "25 diameters left"
            } else if world.time() > limit {
                "time"
            } else {
                ""
            };
            if !reason.is_empty() {
                end_reason = reason;
                let knot =
                    recognize(view.positions(), Ends::Held { start: -(r.position - l.position).normalize(), end: (r.position - l.position).normalize() }, 1);
                eprintln!("drawn: {reason} at {:.3} s, tension {tension:.3} N, {knot}, length left {:.1} d", world.time(), (length - span) / (2.0 * o.r));
                held = false;
                world.remove_grip(left).unwrap();
                world.remove_grip(right).unwrap();
                released_at = Some(world.time());
            }
        }
        if released_at.is_some_and(|t| world.time() > t + o.release) {
            break;
        }
    }
    let report = audit.report();
    let knot = recognize(world.rod(rod).unwrap().positions(), Ends::Free, 1);
    times.sort_by(f64::total_cmp);
    let q = |p: f64| times[((times.len() - 1) as f64 * p) as usize];
    println!(
        "r={} e={:e} speed={} mu={} l={} | passes {} clear {:?} ms {:.2}/{:.2}/{:.2} sub/frame {:.1} rej {} newton/sub {:.2} incidents {} | {} | {}",
        o.r * 1e3,
        o.e,
        o.speed,
        o.mu,
        o.l,
        report.passes_through,
        report.thread_clearance.map(|c| (c * 1e3).round() / 1e3),
        q(0.5),
        q(0.99),
        q(1.0),
        f64::from(subs) / times.len() as f64,
        rejected,
        f64::from(newton) / f64::from(subs + rejected),
        incidents,
        end_reason,
        knot
    );
}
