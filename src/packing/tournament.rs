//! A tournament tree: the smallest of many keys that change one at a time, in O(log N) per change.

/// Keys of `count` entries, all infinite at first; ties go to the lower index.
#[derive(Debug)]
pub struct Tournament {
    /// Node 1 is the root, nodes 2n and 2n + 1 are below node n, the leaves fill the second half.
    nodes: Vec<f64>,
    leaves: usize,
}

impl Tournament {
    /// A tree for entries 0 … `count` − 1.
    #[must_use]
    pub fn new(count: usize) -> Self {
        let leaves = count.max(1).next_power_of_two();
        Self { nodes: vec![f64::INFINITY; 2 * leaves], leaves }
    }

    /// The key of `entry`.
    #[inline]
    #[must_use]
    pub fn key(&self, entry: usize) -> f64 {
        self.nodes[self.leaves + entry]
    }

    /// Give `entry` a new key (not NaN).
    #[inline]
    pub fn set(&mut self, entry: usize, key: f64) {
        let mut node = self.leaves + entry;
        self.nodes[node] = key;
        while node > 1 {
            let smaller = self.nodes[node].min(self.nodes[node ^ 1]);
            node /= 2;
            if self.nodes[node] == smaller {
                return;
            }
            self.nodes[node] = smaller;
        }
    }

    /// The entry with the smallest key, and that key.
    #[inline]
    #[must_use]
    pub fn smallest(&self) -> (usize, f64) {
        let key = self.nodes[1];
        let mut node = 1;
        while node < self.leaves {
            node *= 2;
            if self.nodes[node] != key {
                node += 1;
            }
        }
        (node - self.leaves, key)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_key_is_found_after_any_change() {
        let mut tree = Tournament::new(13);
        let mut keys = [f64::INFINITY; 13];
        for step in 0..1000_usize {
            let (entry, key) = (step * 7 % 13, (step * 7919 % 101) as f64);
            tree.set(entry, key);
            keys[entry] = key;
            let smallest = keys.iter().copied().fold(f64::INFINITY, f64::min);
            let first = keys.iter().position(|key| *key == smallest).unwrap();
            assert_eq!(tree.smallest(), (first, smallest));
        }
    }

    #[test]
    fn one_entry_is_a_tree() {
        let mut tree = Tournament::new(1);
        assert_eq!(tree.smallest(), (0, f64::INFINITY));
        tree.set(0, 2.0);
        assert_eq!(tree.smallest(), (0, 2.0));
    }
}
