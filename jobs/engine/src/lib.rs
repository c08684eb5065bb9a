//! A job from plan to commit.
