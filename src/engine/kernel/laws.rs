//! The laws of all classes of contacts.

use super::Kernel;
use crate::math::instructions::InstructionSet;
use crate::model::dahl::Dahl;
use crate::model::materials::Classes;

/// One kernel for each class of contacts, and which class a contact belongs to.
///
/// All kernels have the same effects, the same repulsion and as many numbers in a memory: they differ in the
/// coefficients of [`Coefficients`](crate::model::materials::Coefficients) only. What does not depend on
/// these, any of them knows: the first.
pub struct Laws {
    kernels: Vec<Box<dyn Kernel>>,
    /// For every class the stiffness of each number of a memory, J.
    stiffness: Vec<Vec<f64>>,
    /// Which class a contact belongs to.
    pub classes: Classes,
}

/// Makes the laws for an instruction set.
pub type MakeLaws<'a> = dyn Fn(InstructionSet) -> Laws + 'a;

impl From<Box<dyn Kernel>> for Laws {
    /// One law for all contacts.
    fn from(kernel: Box<dyn Kernel>) -> Self {
        Laws::new(vec![kernel], Classes::default())
    }
}

impl Laws {
    /// The laws of these `classes`: the kernel of each, in their order.
    ///
    /// # Panics
    ///
    /// Panics if there are not as many kernels as classes.
    pub fn new(kernels: Vec<Box<dyn Kernel>>, classes: Classes) -> Self {
        assert_eq!(kernels.len(), classes.count(), "every class has a kernel");
        let numbers = |(numbers, element): &(usize, Dahl)| std::iter::repeat_n(element.stiffness(), *numbers);
        let stiffness = kernels.iter().map(|kernel| kernel.elements().iter().flat_map(numbers).collect());
        Laws { stiffness: stiffness.collect(), kernels, classes }
    }

    /// Number of classes.
    pub fn count(&self) -> usize {
        self.kernels.len()
    }

    /// The kernel of the first class, for what is the same in all.
    pub fn first(&self) -> &dyn Kernel {
        &*self.kernels[0]
    }

    /// The kernel of a class.
    pub fn of(&self, class: usize) -> &dyn Kernel {
        &*self.kernels[class]
    }

    /// From now on contacts are evaluated up to `gap` (m).
    pub fn set_cutoff(&mut self, gap: f64) {
        self.kernels.iter_mut().for_each(|kernel| kernel.set_cutoff(gap));
    }

    /// Energy that a contact at rest stores at `gap` (m), J: the most of all classes.
    pub fn most_stored(&self, gap: f64) -> f64 {
        self.kernels.iter().map(|kernel| kernel.stored(gap)).fold(0.0, crate::math::larger)
    }

    /// The stiffness of each number of a memory in a class, J: what the memory stores is half of that times
    /// the square of the number.
    pub fn stiffness(&self, class: usize) -> &[f64] {
        &self.stiffness[class]
    }

    /// For every class, its elements; see [`Kernel::elements`].
    pub fn elements(&self) -> impl Iterator<Item = &[(usize, Dahl)]> {
        self.kernels.iter().map(|kernel| kernel.elements())
    }
}
