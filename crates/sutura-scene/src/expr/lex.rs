//! Words and marks of an expression. A number takes the unit that follows it.

use crate::units::{Dim, Quantity, number_length, symbol};

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Token {
    Quantity(Quantity, String),
    Word(String),
    Text(String),
    Mark(&'static str),
}

impl std::fmt::Display for Token {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Token::Quantity(_, t) | Token::Word(t) => write!(f, "{t}"),
            Token::Text(t) => write!(f, "'{t}'"),
            Token::Mark(m) => write!(f, "{m}"),
        }
    }
}

/// What is wrong, and what may have been meant.
pub(super) type Message = (String, Option<String>);

const MARKS: &[&str] = &["==", "!=", ">=", "<=", ">", "<", "+", "-", "*", "/", "(", ")", ",", ".", "[", "]"];

pub(super) fn lex(text: &str) -> Result<Vec<Token>, Message> {
    let mut tokens = Vec::new();
    let mut rest = text.trim_start();
    while let Some(c) = rest.chars().next() {
        if c.is_ascii_digit() || (c == '.' && rest[1..].starts_with(|d: char| d.is_ascii_digit())) {
            let n = number_length(rest);
            let value: f64 =
                rest[..n].replace('_', "").parse().map_err(|_| (format!("`{}` is not a number", &rest[..n]), None))?;
            if !value.is_finite() {
                return Err((format!("`{}` is too large", &rest[..n]), None));
            }
            let (unit, used) = unit_after(&rest[n..]);
            let (value, dim) = (value * unit.0, unit.1);
            tokens.push(Token::Quantity(Quantity { value, dim }, rest[..n + used].trim().into()));
            rest = &rest[n + used..];
        } else if c.is_alphabetic() || c == '_' {
            let n = rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len());
            tokens.push(Token::Word(rest[..n].into()));
            rest = &rest[n..];
        } else if c == '\'' || c == '"' {
            let Some(n) = rest[1..].find(c) else {
                return Err((format!("the text `{rest}` has no closing quote"), None));
            };
            tokens.push(Token::Text(rest[1..=n].into()));
            rest = &rest[n + 2..];
        } else if let Some(mark) = MARKS.iter().find(|m| rest.starts_with(**m)) {
            tokens.push(Token::Mark(mark));
            rest = &rest[mark.len()..];
        } else {
            let help = match c {
                '=' => Some("equality is `==`".into()),
                '&' | '|' | '!' => Some("write `and`, `or`, `not`".into()),
                _ => None,
            };
            return Err((format!("`{c}` is not expected in `{text}`"), help));
        }
        rest = rest.trim_start();
    }
    Ok(tokens)
}

/// The unit that follows a number: factors joined by spaces or `*`, `/` before a factor divides. Returns size,
/// dimension and bytes used. A word that is no unit ends it, so `2 N and ..` and `2 * x` read as expected.
fn unit_after(text: &str) -> ((f64, Dim), usize) {
    let (mut size, mut dim, mut used) = (1.0, Dim::NUMBER, 0);
    let mut first = true;
    loop {
        let rest = &text[used..];
        let trimmed = rest.trim_start();
        let mut at = rest.len() - trimmed.len();
        let (mut divide, mut piece) = (false, trimmed);
        if let Some(after) = trimmed.strip_prefix('/') {
            divide = true;
            piece = after.trim_start();
            at += trimmed.len() - piece.len();
        }
        if divide && first && at > 0 && !matches!(trimmed.as_bytes().get(1), Some(b'a'..=b'z' | b'A'..=b'Z')) {
            return ((size, dim), used);
        }
        let n = piece.find(|c: char| !(c.is_alphabetic() || c == '%' || c == '°')).unwrap_or(piece.len());
        // `2 x(..)` or `2 mm_` would not be units.
        let next = piece[n..].chars().next();
        let Some(unit) = symbol(&piece[..n]).filter(|_| !matches!(next, Some('(' | '_' | '0'..='9'))) else {
            return ((size, dim), used);
        };
        let mut power: i8 = if divide { -1 } else { 1 };
        let mut end = at + n;
        if let Some(digits) = piece[n..].strip_prefix('^') {
            let m = digits.find(|c: char| !(c.is_ascii_digit() || c == '-')).unwrap_or(digits.len());
            let Some(p) = digits[..m].parse::<i8>().ok().filter(|p| p.abs() <= 9) else { return ((size, dim), used) };
            power *= p;
            end += 1 + m;
        }
        size *= unit.size.powi(i32::from(power));
        dim = dim.times(unit.dim.power(power));
        used += end;
        first = false;
    }
}
