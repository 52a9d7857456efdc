//! A table of positions and frames.

use super::{ExportError, Moment, Output, Seen, Writer};

/// Rows so far.
pub struct Csv {
    table: csv::Writer<Vec<u8>>,
}

const COLUMNS: [&str; 10] = ["time [s]", "thread", "particle", "x [m]", "y [m]", "z [m]", "qx", "qy", "qz", "qw"];

impl Csv {
    pub fn new() -> Self {
        let mut csv = Csv { table: csv::Writer::from_writer(Vec::new()) };
        csv.row(COLUMNS.map(str::to_owned));
        csv
    }

    fn row(&mut self, cells: [String; 10]) {
        self.table.write_record(cells).expect("a row in memory, of as many cells as the others");
    }
}

impl Writer for Csv {
    fn add(&mut self, seen: &Seen<'_>, moment: &Moment, _: &mut Output) -> Result<(), ExportError> {
        for (thread, strand) in seen.header.threads.iter().zip(&moment.threads) {
            for (i, x) in strand.positions.iter().enumerate() {
                // The last particle has no element after it.
                let q = strand
                    .orientations
                    .get(i)
                    .map_or([const { String::new() }; 4], |q| q.to_array().map(|v| v.to_string()));
                let [x, y, z] = x.to_array().map(|v| v.to_string());
                let [a, b, c, d] = q;
                self.row([moment.time.to_string(), thread.name.clone(), i.to_string(), x, y, z, a, b, c, d]);
            }
        }
        Ok(())
    }

    fn finish(self: Box<Self>, _: &Seen<'_>, out: &mut Output) -> Result<(), ExportError> {
        let bytes = self.table.into_inner().expect("a table in memory");
        out.write(None, &bytes)
    }
}
