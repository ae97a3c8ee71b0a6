//! What keeps a motion within limits: each node holds some of what an arm's command must have crossed.

pub mod joint_limit;
