//! Budgets of limiters: while one is spent, its arm rests and the others go on.

use super::engine::Engine;
use super::halt::Rest;
use crate::fault::{Cause, Fault};
use crate::graph::Policy;
use crate::signal::Flag;

/// Maximum number of rests that are kept for the summary.
const MAX_RESTS: usize = 1000;

impl Engine {
    /// Notes budgets that were spent or refilled in this tick.
    ///
    /// # Errors
    /// Returns the fault of a spent budget if the policy for it is `fault`.
    pub(super) fn watch_budgets(&mut self) -> Result<(), Fault> {
        for i in 0..self.budgets.len() {
            let budget = &mut self.budgets[i];
            let is_spent = self.core.bus.get::<Flag>(budget.flag).is_some_and(|is_spent| *is_spent);
            if std::mem::replace(&mut budget.is_spent, is_spent) != is_spent {
                self.change_budget(i)?;
            }
        }
        Ok(())
    }

    /// Begins or ends the rest of an arm.
    #[cold]
    fn change_budget(&mut self, budget: usize) -> Result<(), Fault> {
        let budget = &self.budgets[budget];
        if !budget.is_spent {
            let open = self.rests.iter_mut().find(|rest| rest.until.is_none() && rest.role == budget.role);
            open.into_iter().for_each(|rest| rest.until = Some(self.core.tick.now));
            return Ok(());
        }
        let (node, place) = &self.names[budget.runner];
        let fault = self.fault(node, None, Cause::Spent, place.clone());
        let task = self.core.task_of(budget.runner);
        if self.tasks[task].policy.blind.0 == Policy::Fault {
            return self.fail(task, fault);
        }
        tracing::warn!("{fault}: `{}` stops", budget.role);
        if self.rests.len() < MAX_RESTS {
            self.rests.push(Rest { role: budget.role.clone(), fault, until: None });
        }
        Ok(())
    }

    /// Returns the times in which an arm rested because a budget of its limiter was spent.
    #[must_use]
    pub fn rests(&self) -> &[Rest] {
        &self.rests
    }
}
