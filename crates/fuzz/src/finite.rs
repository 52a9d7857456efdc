//! Everything that can be read of a world, and whether it is finite. An error names what is not.

use sutura::glam::{DQuat, DVec3};
use sutura::{ContactSide, StepReport, View, World};

/// Nothing, or what is wrong.
pub type Found = Result<(), String>;

/// What the state itself holds: finite whatever was reported, since a substep with a number that is not is put back.
pub fn state(view: View<'_>) -> Found {
    one("time", view.time())?;
    for rod in view.rods() {
        all("position", rod.positions())?;
        all("velocity", rod.velocities())?;
        all("angular velocity", rod.angular_velocities())?;
        rod.orientations().iter().try_for_each(|q| rotation("frame", *q))?;
    }
    for shape in view.shapes() {
        all("position of a shape", &[shape.pose.position])?;
        rotation("frame of a shape", shape.pose.orientation)?;
    }
    for weld in view.welds() {
        all("position of a weld", &[weld.pose.position])?;
        rotation("frame of a weld", weld.pose.orientation)?;
    }
    Ok(())
}

/// State, and what is worked out from it: finite where no incident says otherwise.
pub fn readings(world: &World) -> Found {
    state(world.view())?;
    for rod in world.view().rods() {
        let n = rod.n_elements();
        for e in 0..n {
            all("internal force", &[rod.internal_force(e)])?;
            all("bending stiffness", &[rod.bending_stiffness(e)])?;
            one("axial stiffness", rod.axial_stiffness(e))?;
            one("mass per length", rod.mass_per_length(e))?;
        }
        for joint in 0..rod.n_joints() {
            all("strain", &[rod.strain(joint)])?;
            all("moment", &[rod.moment(joint)])?;
        }
        one("elongation", rod.max_elongation())?;
        one("tension", rod.max_tension())?;
        one("rest length", rod.rest_length())?;
        one("arc", rod.arc(n))?;
        one("twist", rod.twist())?;
        one("writhe", sutura::knot::writhe(rod.positions(), false))?;
        all("momentum", &[rod.momentum()])?;
        let e = rod.energy();
        for (what, v) in [
            ("kinetic", e.kinetic),
            ("stretch", e.stretch),
            ("bend", e.bend),
            ("twist", e.twist),
            ("gravity", e.gravity),
            ("total", e.total()),
        ] {
            one(&format!("{what} energy"), v)?;
        }
    }
    for contact in world.contacts() {
        all("contact", &[contact.point, contact.normal, contact.force])?;
        for (_, _, s) in [contact.a, contact.b].iter().filter_map(ContactSide::thread) {
            one("place of a contact", s)?;
        }
    }
    Ok(())
}

/// A step's report.
pub fn report(report: &StepReport) -> Found {
    one("time", report.time)?;
    report.incidents.iter().try_for_each(|i| one("time of an incident", i.time))?;
    if !report.incidents.is_empty() {
        return Ok(());
    }
    one("residual", report.residual)?;
    one("length error", report.length_error)?;
    [report.thread_clearance, report.shape_clearance].into_iter().flatten().try_for_each(|c| one("clearance", c))?;
    if report.converged { Ok(()) } else { Err("a step did not converge and says nothing".into()) }
}

pub fn all(what: &str, values: &[DVec3]) -> Found {
    values.iter().find(|v| !v.is_finite()).map_or(Ok(()), |v| Err(format!("{what} {v}")))
}

pub fn one(what: &str, value: f64) -> Found {
    if value.is_finite() { Ok(()) } else { Err(format!("{what} {value}")) }
}

fn rotation(what: &str, q: DQuat) -> Found {
    if q.is_finite() && (q.length() - 1.0).abs() < 1e-6 { Ok(()) } else { Err(format!("{what} {q}")) }
}

/// Ends the run of an input that found a fault.
#[track_caller]
pub fn assert(found: Found) {
    if let Err(what) = found {
        panic!("not finite: {what}");
    }
}
