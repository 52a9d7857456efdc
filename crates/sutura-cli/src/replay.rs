//! The command `sutura replay`: does a recorded input again, here, and says at which step the state is another one.

use crate::args::Replay;
use crate::say;
use anyhow::Context as _;
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::Path;
use sutura::input::{Input, Recording};
use sutura::{ContactSide, World};

/// Runs the command; false when something differs.
pub fn replay(args: &Replay) -> anyhow::Result<bool> {
    let recording = read(&args.file)?;
    if args.list {
        let lines: Vec<String> = recording.inputs.iter().map(line).collect();
        say(&lines.join("\n"))?;
        return Ok(true);
    }
    if args.hashes {
        let hash = |i: &Input| if let Input::Step(_, hash) = i { Some(format!("{hash:016x}\n")) } else { None };
        let lines: String = recording.inputs.iter().filter_map(hash).collect();
        if !lines.is_empty() {
            say(&lines)?;
        }
        return Ok(true);
    }
    if let Some(other) = &args.with {
        return compare(&recording, &read(other)?, args.quiet);
    }
    let (mut steps, mut time, mut differs) = (0, 0.0, None);
    let stop = args.until.unwrap_or(f64::INFINITY);
    let world = recording.replay(&mut |replayed| {
        (steps, time) = (replayed.step, replayed.world.time());
        if !replayed.is_same() && differs.is_none() {
            differs = Some((replayed.step, replayed.recorded, replayed.found));
        }
        // Rounding of the sum of steps must not cost or add one.
        let over = time > stop * (1.0 - 1e-9) || (differs.is_some() && args.until.is_none());
        if over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    if let Some(path) = &args.state {
        crate::output::put(path, numbers(&world).as_bytes())?;
    }
    match differs {
        None if args.quiet => {}
        None => say(&format!(
            "{steps} steps, {time:.4} s: the same state after every step, the last {:016x}",
            world.state_hash()
        ))?,
        Some((step, recorded, found)) => {
            let mut out = format!(
                "differs after step {step} first: state {recorded:016x} was recorded, {found:016x} was found\n"
            );
            before(&recording, step, &mut out);
            say(&out)?;
        }
    }
    Ok(differs.is_none())
}

fn read(path: &Path) -> anyhow::Result<Recording> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    Recording::from_bytes(&bytes).with_context(|| path.display().to_string())
}

/// Two recordings of what should be the same.
fn compare(a: &Recording, b: &Recording, quiet: bool) -> anyhow::Result<bool> {
    let Some(first) = a.first_difference(b) else {
        let (steps, time) = a.steps_within(a.inputs.len());
        if !quiet {
            say(&format!("{steps} steps, {time:.4} s: the same inputs, and the same state after every step"))?;
        }
        return Ok(true);
    };
    let (steps, time) = a.steps_within(first);
    let end = || "the end".to_string();
    let [left, right] = [a, b].map(|r| r.inputs.get(first).map_or_else(end, line));
    say(&format!("the same for {steps} steps, {time:.4} s; then, input {first}:\n  {left}\n  {right}"))?;
    Ok(false)
}

/// What was done between a step and the one before it.
fn before(recording: &Recording, step: usize, out: &mut String) {
    let is_step = |i: &&Input| matches!(i, Input::Step(..));
    let at = recording.inputs.iter().enumerate().filter(|(_, i)| is_step(i)).nth(step - 1).map_or(0, |(i, _)| i);
    let (_, time) = recording.steps_within(at);
    let _ = writeln!(out, "it begins at {time:.6} s; done before it:");
    let since = recording.inputs[..at].iter().rev().take_while(|i| !is_step(i)).count();
    for input in &recording.inputs[at - since..=at] {
        let _ = writeln!(out, "  {}", line(input));
    }
}

/// An input in a line; hashes as they are written elsewhere.
fn line(input: &Input) -> String {
    match input {
        Input::Step(dt, hash) => format!("Step({dt} s, state {hash:016x})"),
        Input::Restore(bytes) => format!("Restore({} bytes)", bytes.len()),
        other => format!("{other:?}"),
    }
}

/// Every number of threads, shapes and bodies, and the contacts that carry force, one a line with its bits, so that two
/// states can be compared.
fn numbers(world: &World) -> String {
    let mut out = String::from("what,part,component,value,bits\n");
    let mut put = |what: &str, part: usize, values: &[f64]| {
        for (c, v) in values.iter().enumerate() {
            let _ = writeln!(out, "{what},{part},{c},{v:?},{:016x}", v.to_bits());
        }
    };
    put("time", 0, &[world.time()]);
    for rod in world.view().rods() {
        let name = |what: &str| format!("thread {} {what}", rod.slot());
        for (i, (x, v)) in rod.positions().iter().zip(rod.velocities()).enumerate() {
            put(&name("position"), i, &x.to_array());
            put(&name("velocity"), i, &v.to_array());
        }
        for (e, (q, w)) in rod.orientations().iter().zip(rod.angular_velocities()).enumerate() {
            put(&name("orientation"), e, &q.to_array());
            put(&name("angular velocity"), e, &w.to_array());
            put(&name("force"), e, &rod.internal_force(e).to_array());
        }
    }
    for shape in world.view().shapes() {
        put(&format!("shape {} position", shape.slot), 0, &shape.pose.position.to_array());
        put(&format!("shape {} orientation", shape.slot), 0, &shape.pose.orientation.to_array());
    }
    for body in world.view().bodies() {
        put(&format!("body {} velocity", body.slot()), 0, &body.velocity().to_array());
        put(&format!("body {} angular velocity", body.slot()), 0, &body.angular_velocity().to_array());
    }
    let side = |side: &ContactSide| match *side {
        ContactSide::Thread { rod, element, s } => format!("thread {rod} element {element} place {s}"),
        ContactSide::Shape { shape } => format!("shape {shape}"),
        _ => "another".to_owned(),
    };
    for (i, contact) in world.contacts().enumerate() {
        put(&format!("contact of {} with {}", side(&contact.a), side(&contact.b)), i, &contact.force.to_array());
    }
    out
}
