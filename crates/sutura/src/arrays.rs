//! Arrays with one entry per particle and element of a structure, listed once for all that cuts, joins and removes
//! elements.

macro_rules! element_arrays {
    ($structure:ty { $($array:ident),* $(,)? }) => {
        impl $structure {
            /// Puts a copy of an entry after it.
            pub(crate) fn repeat_entry(&mut self, e: usize) {
                $(self.$array.insert(e + 1, self.$array[e].clone());)*
            }
            pub(crate) fn remove_entry(&mut self, e: usize) {
                self.remove_entries(e..e + 1);
            }
            pub(crate) fn remove_entries(&mut self, entries: core::ops::Range<usize>) {
                $(self.$array.drain(entries.clone());)*
            }
            /// Begins the entries of a range with the one at `first`, those before it after the others.
            pub(crate) fn rotate_entries(&mut self, entries: core::ops::Range<usize>, first: usize) {
                $(self.$array[entries.clone()].rotate_left(first - entries.start);)*
            }
            /// Whether each array has this many entries.
            pub(crate) fn has_entries(&self, n: usize) -> bool {
                true $(&& self.$array.len() == n)*
            }
        }
    };
}

pub(crate) use element_arrays;
