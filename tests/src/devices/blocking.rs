//! `blocking`: a live length whose driver blocks its thread, as a bad library does.

use std::time::Duration;

use async_trait::async_trait;
use tactflow_runtime::device::{Description, Device, DeviceError, Driver, Link, Live, Opened};
use tactflow_runtime::node::{Describe, Mistakes};
use tactflow_runtime::signal::{Scalar, ScalarShape, Unit};

/// A length that never comes, from a driver that blocks its thread for a minute.
#[derive(Describe)]
pub struct Blocking;

#[async_trait]
impl Live for Blocking {
    async fn run(self: Box<Self>, _: Link) -> Result<(), DeviceError> {
        std::thread::sleep(Duration::from_secs(60));
        Err("too late".into())
    }
}

impl Device for Blocking {
    type Params = ();

    fn open((): ()) -> Result<Opened, Mistakes> {
        let mut description = Description::every(0.01);
        description.fills("length").output::<Scalar>("value", ScalarShape::of(Unit::METRE));
        Ok(Opened { description, driver: Driver::Live(Box::new(Self)) })
    }
}
