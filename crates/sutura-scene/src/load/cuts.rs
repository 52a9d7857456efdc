//! Threads that are cut, and the parts that come of it.

use super::*;

impl<'d> Loader<'d> {
    /// Names the parts that actions cut off, in the order in which they come.
    pub(super) fn name_parts(&mut self, root: &Table<'d>) {
        let mut closed: Vec<bool> = self.extents.iter().map(|e| e.1).collect();
        for table in root.tables("phase").iter().flat_map(|phase| phase.tables("action")) {
            let Some(thread) = table.get("cut").filter(Value::is_text).and_then(|v| v.text()) else { continue };
            let Some(Named::Thread(index)) = self.names.get(&thread) else { continue };
            if closed.get(index) == Some(&true) {
                // It opens and stays one.
                closed[index] = false;
                continue;
            }
            let name = match table.get("name") {
                Some(v) => v.is_text().then(|| self.checked_name(&v)).flatten(),
                None => Some(default_name(&thread)),
            };
            let part = closed.len();
            closed.push(false);
            if let Some(name) = name
                && !self.names.add(&name, Named::Thread(part))
            {
                table.problem(format!("the name `{name}` is taken"), Some("`name` names the part cut off".into()));
            }
        }
    }

    /// The parts of a saved state, and how long what was cut is there.
    pub(super) fn take_up_cuts(&mut self, saved: &SavedFile, location: &Location) {
        for event in &saved.events {
            let Event::Cut { thread, particle, part } = event else { continue };
            let Some(Named::Thread(index)) = self.names.get(thread) else { continue };
            let (lengths, closed) = &self.extents[index];
            let place = Place::Particle(*particle);
            let parting = Parting::at(lengths, *closed, place);
            if let Some(part) = part {
                if !self.names.add(part, Named::Thread(self.threads.len())) {
                    self.doc.problem_at(location, format!("the name `{part}` is that of a part in it"));
                }
                self.add_part(index, part.clone(), location.clone());
            }
            self.follow(index, &parting);
        }
    }

    /// `cut = "thread"` with `at` and `name`.
    pub(super) fn cut(&mut self, table: &Table<'d>, thread: usize) -> Option<Action> {
        let value = table.need("at", "where: a length from the start, or a place such as \"middle\"");
        let place = value.as_ref().and_then(|v| self.place(v, thread));
        let (lengths, closed) = self.extents[thread].clone();
        let parting = Parting::at(&lengths, closed, place.unwrap_or(Place::Arc(0.5 * lengths.iter().sum::<f64>())));
        let part = if closed {
            if let Some(v) = table.get("name") {
                v.problem("a closed thread that is cut is open and stays one: nothing is cut off", None);
            }
            None
        } else {
            let name = match table.get("name") {
                Some(v) => v.text().map(std::borrow::Cow::into_owned),
                None => Some(default_name(&self.threads[thread].name)),
            };
            let part = self.threads.len();
            self.add_part(thread, name.unwrap_or_default(), table.location());
            if let Some(v) = value
                && (parting.particle == 0 || parting.particle == lengths.len())
            {
                v.problem(
                    format!("the thread has {} elements; at least one is to be left on either side", lengths.len()),
                    None,
                );
            }
            Some(part)
        };
        self.follow(thread, &parting);
        Some(Action::Cut { thread, place: place?, part })
    }

    fn add_part(&mut self, of: usize, name: String, location: Location) {
        self.threads.push(ThreadDef { name, location, ..self.threads[of].clone() });
    }

    /// Takes note of what is left of a thread, and of its rest.
    fn follow(&mut self, thread: usize, parting: &Parting) {
        let (left, rest) = parting.parts();
        self.extents[thread] = (left, false);
        self.extents.extend(rest.map(|rest| (rest, false)));
    }
}

/// Name of a part that has none of its own.
fn default_name(thread: &str) -> String {
    format!("{thread}.cut")
}
