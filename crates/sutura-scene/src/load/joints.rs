//! Joints of bodies.

use super::*;
use crate::scene::JointDef;
use sutura::glam::DQuat;
use sutura::{JointKind, Motor};

impl<'d> Loader<'d> {
    pub(super) fn joint(&self, table: &Table<'d>) -> Option<JointDef> {
        // Expressions name it.
        let named = table.need("name", "the name of the joint").is_some();
        let kinds = [
            ("fixed", JointKind::Fixed),
            ("ball", JointKind::Ball),
            ("hinge", JointKind::Hinge),
            ("slider", JointKind::Slider),
        ];
        let kind = table.need("kind", "fixed, ball, hinge or slider").and_then(|v| v.choice(&kinds));
        let bodies = self.joined(table);
        let at = table.need_vector("at", Dim::LENGTH);
        let has_axis = matches!(kind, Some(JointKind::Hinge | JointKind::Slider));
        let axis = if has_axis {
            table.need("axis", "the axis that the joint turns about or moves along").and_then(|v| v.direction())
        } else {
            Some(DVec3::Z)
        };
        for key in ["axis", "limits", "motor", "friction"] {
            if let (Some(_), false, Some(value)) = (kind, has_axis, table.get(key)) {
                value.problem("only a hinge and a slider have an axis", None);
            }
        }
        let turns = kind == Some(JointKind::Hinge);
        let (coordinate, speed, force) =
            if turns { (Dim::ANGLE, Dim::SPIN, Dim::TORQUE) } else { (Dim::LENGTH, Dim::SPEED, Dim::FORCE) };
        let limits = table.get("limits").filter(|_| has_axis).and_then(|v| limits(&v, coordinate));
        let motor = table.get("motor").filter(|_| has_axis).and_then(|v| {
            let motor = v.table()?;
            let speed = motor.need_quantity("speed", speed);
            let most = if turns { positive(&motor, "torque", force) } else { positive(&motor, "force", force) };
            let (wanted, other) = if turns { ("torque", "force") } else { ("force", "torque") };
            if !motor.has(wanted) {
                motor.problem(format!("`{wanted}` is missing: the most that the motor exerts"), None);
            }
            if let Some(value) = motor.get(other) {
                value.problem(
                    format!("the motor of a {} has a `{wanted}`", if turns { "hinge" } else { "slider" }),
                    None,
                );
            }
            motor.finish();
            Some(Motor { speed: speed?, most: most? })
        });
        let least = |key: &str, dim: Dim| in_range(table, key, dim, 0.0, f64::MAX).unwrap_or(0.0);
        let friction = if has_axis { least("friction", force) } else { 0.0 };
        let compliance = least("compliance", Dim::LENGTH.over(Dim::FORCE));
        let angular_compliance = least("angular_compliance", Dim::ANGLE.over(Dim::TORQUE));
        let touch = table.truth_or("touch", false);
        named.then_some(())?;
        Some(JointDef {
            kind: kind?,
            bodies: bodies?,
            at: Pose::new(at?, DQuat::from_rotation_arc(DVec3::Z, axis?)),
            limits,
            motor,
            friction,
            compliance: [compliance, angular_compliance],
            touch,
            location: table.location(),
        })
    }

    /// Two bodies, or the world and one.
    fn joined(&self, table: &Table<'d>) -> Option<[Option<usize>; 2]> {
        let find = |v: &Value<'d>| self.find(v, "body", |n| if let Named::Body(i) = n { Some(i) } else { None });
        let wanted = "two names of bodies, such as [\"arm\", \"hand\"]";
        let Some(value) = table.get("bodies") else {
            return table
                .need("body", "the body that it holds to the world, or `bodies`")
                .and_then(|v| Some([None, Some(find(&v)?)]));
        };
        if let Some(other) = table.get("body") {
            other.problem("`body` and `bodies` exclude each other", None);
        }
        let items = value.array(wanted)?;
        let [first, second] = items.as_slice() else {
            value.problem(format!("found {} names, wanted two", items.len()), None);
            return None;
        };
        let (first, second) = (find(first), find(second));
        if first.is_some() && first == second {
            value.problem("a body is not joined with itself", None);
            return None;
        }
        Some([Some(first?), Some(second?)])
    }
}

/// The least and the greatest.
fn limits(value: &Value<'_>, dim: Dim) -> Option<[f64; 2]> {
    let found = value.quantities(dim, &format!("two numbers, each {dim}"))?;
    match found.as_slice() {
        [least, most] if least < most => Some([*least, *most]),
        [_, _] => {
            value.problem("the smaller limit comes first", None);
            None
        }
        other => {
            value.problem(format!("found {} numbers, wanted two", other.len()), None);
            None
        }
    }
}
