//! Points from a table, as other programs write it: the input of `sutura knot`.

use sutura::glam::DVec3;

/// Why a table could not be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TableError {
    /// A row is not what it should be.
    #[error("line {line}: {reason}")]
    Row {
        /// Line of the file, from 1.
        line: u64,
        /// What is wrong there.
        reason: String,
    },
    /// There are too few rows to be a curve.
    #[error("{0} points, wanted at least 3 (comma-separated x, y, z)")]
    TooFew(usize),
}

/// Points from comma-separated values. The first row may hold headings; when they name x, y and z, those columns are
/// taken, otherwise the first three. Lines that begin with `#` are remarks.
pub fn points_from_table(bytes: &[u8]) -> Result<Vec<DVec3>, TableError> {
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(bytes);
    let mut columns = [0, 1, 2];
    let mut points = Vec::new();
    for (row, record) in reader.records().enumerate() {
        let record = record.map_err(|e| TableError::Row {
            line: e.position().map_or(0, csv::Position::line),
            reason: e.to_string(),
        })?;
        let line = record.position().map_or(0, csv::Position::line);
        let wrong = |reason: String| TableError::Row { line, reason };
        if row == 0 && record.iter().take(3).all(|f| f.parse::<f64>().is_err()) {
            let named = |name: &str| {
                record
                    .iter()
                    .position(|f| f.split([' ', '[', '(']).next().is_some_and(|w| w.eq_ignore_ascii_case(name)))
            };
            if let (Some(x), Some(y), Some(z)) = (named("x"), named("y"), named("z")) {
                columns = [x, y, z];
            }
            continue;
        }
        let mut p = [0.0; 3];
        for (v, &column) in p.iter_mut().zip(&columns) {
            let field = record.get(column).ok_or_else(|| wrong(format!("{} columns, wanted x, y, z", record.len())))?;
            *v = field
                .parse()
                .ok()
                .filter(|v: &f64| v.is_finite())
                .ok_or_else(|| wrong(format!("`{field}` is not a finite number")))?;
        }
        points.push(DVec3::from(p));
    }
    if points.len() < 3 { Err(TableError::TooFew(points.len())) } else { Ok(points) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_found_by_their_headings_or_are_the_first_three() {
        let last = |text: &str| points_from_table(text.as_bytes()).map(|p| p[2]);
        assert_eq!(last("time,z [m],X (m),y\n0,3,1,2\n1,6,4,5\n# a remark\n2,9,7,8\n"), Ok(DVec3::new(7.0, 8.0, 9.0)));
        assert_eq!(last("a,b,c\n1,2,3\n4,5,6\n 7, 8 ,9,10\n"), Ok(DVec3::new(7.0, 8.0, 9.0)));
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        let error = |text: &[u8]| points_from_table(text).unwrap_err().to_string();
        assert_eq!(error(b"1,2,3\n4,5\n"), "line 2: 2 columns, wanted x, y, z");
        assert_eq!(error(b"1,2,3\n4,5,inf\n"), "line 2: `inf` is not a finite number");
        assert_eq!(error(b"x,y,z\n1,2,3\n"), "1 points, wanted at least 3 (comma-separated x, y, z)");
        assert!(error(b"1,2,3\n4,5,\xff\n").starts_with("line 2: "));
    }
}
