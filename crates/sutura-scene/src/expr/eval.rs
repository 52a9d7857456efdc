//! The value of a checked expression in the running world.

use super::function::Maths;
use super::{Live, Node, Op, Value};
use sutura::glam::DVec3;

fn number(value: &Value) -> f64 {
    match value {
        Value::Number(v) => *v,
        Value::Vector(v) => v.length(),
        _ => f64::NAN,
    }
}

fn vector(value: &Value) -> DVec3 {
    match value {
        Value::Vector(v) => *v,
        _ => DVec3::NAN,
    }
}

/// Whether a text is the one wanted. The name of a knot without its hand stands for both: `trefoil` for `trefoil-left`.
pub fn texts_match(found: &str, wanted: &str) -> bool {
    found == wanted || found.strip_suffix("-right").or(found.strip_suffix("-left")) == Some(wanted)
}

pub(super) fn eval(node: &Node, live: &dyn Live) -> Value {
    match node {
        Node::Constant(v) => v.clone(),
        Node::Read(read, args) => live.read(*read, args),
        Node::Probe(i) => live.probe(*i),
        Node::Vector(parts) => Value::Vector(DVec3::from_array([0, 1, 2].map(|i| number(&eval(&parts[i], live))))),
        Node::Pick(inner, i) => Value::Number(match eval(inner, live) {
            Value::Vector(v) => v[*i],
            Value::Columns(c) => c.get(*i).copied().unwrap_or(f64::NAN),
            _ => f64::NAN,
        }),
        Node::Negate(inner) => match eval(inner, live) {
            Value::Vector(v) => Value::Vector(-v),
            other => Value::Number(-number(&other)),
        },
        Node::Not(inner) => Value::Truth(eval(inner, live) != Value::Truth(true)),
        Node::Maths(m, args) => {
            let v: Vec<Value> = args.iter().map(|a| eval(a, live)).collect();
            let n = |i: usize| number(&v[i]);
            Value::Number(match m {
                Maths::Abs => n(0).abs(),
                Maths::Sqrt => n(0).sqrt(),
                Maths::Sin => n(0).sin(),
                Maths::Cos => n(0).cos(),
                Maths::Exp => n(0).exp(),
                Maths::Ln => n(0).ln(),
                Maths::Atan2 => n(0).atan2(n(1)),
                Maths::Norm => n(0),
                // A missing value stays missing.
                Maths::Min if n(0).is_nan() || n(1).is_nan() => f64::NAN,
                Maths::Max if n(0).is_nan() || n(1).is_nan() => f64::NAN,
                Maths::Min => n(0).min(n(1)),
                Maths::Max => n(0).max(n(1)),
                Maths::Dot => vector(&v[0]).dot(vector(&v[1])),
                Maths::Angle => {
                    let (a, b) = (vector(&v[0]), vector(&v[1]));
                    a.cross(b).length().atan2(a.dot(b))
                }
            })
        }
        Node::Binary(op, a, b) => {
            let a = eval(a, live);
            // The right side of `and`, `or` may be dear (a knot): only when it matters.
            match op {
                Op::And if a != Value::Truth(true) => return Value::Truth(false),
                Op::Or if a == Value::Truth(true) => return Value::Truth(true),
                _ => {}
            }
            let b = eval(b, live);
            let (x, y) = (number(&a), number(&b));
            match op {
                Op::And | Op::Or => Value::Truth(b == Value::Truth(true)),
                Op::Add | Op::Sub if matches!(a, Value::Vector(_)) => {
                    let y = vector(&b);
                    Value::Vector(vector(&a) + if *op == Op::Add { y } else { -y })
                }
                Op::Add => Value::Number(x + y),
                Op::Sub => Value::Number(x - y),
                Op::Mul | Op::Div => match (&a, &b) {
                    (Value::Vector(v), _) => Value::Vector(if *op == Op::Mul { *v * y } else { *v / y }),
                    (_, Value::Vector(v)) => Value::Vector(*v * x),
                    _ => Value::Number(if *op == Op::Mul { x * y } else { x / y }),
                },
                Op::Eq | Op::Ne => {
                    let missing =
                        matches!(&a, Value::Number(v) if v.is_nan()) || matches!(&b, Value::Number(v) if v.is_nan());
                    let same = match (&a, &b) {
                        (Value::Text(a), Value::Text(b)) => texts_match(a, b) || texts_match(b, a),
                        _ => a == b,
                    };
                    Value::Truth(!missing && same == (*op == Op::Eq))
                }
                Op::Lt => Value::Truth(x < y),
                Op::Le => Value::Truth(x <= y),
                Op::Gt => Value::Truth(x > y),
                Op::Ge => Value::Truth(x >= y),
            }
        }
    }
}
