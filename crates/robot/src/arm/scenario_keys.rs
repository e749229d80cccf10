//! An arm's values by the keys of scenarios that leave them out.

use toml::{Table, Value};

use super::data::ArmData;

impl ArmData {
    /// The arm's values by the scenario's keys, for what a scenario leaves out.
    ///
    /// # Errors
    /// None that is known of.
    pub fn by_scenario_keys(&self) -> Result<Value, toml::ser::Error> {
        let mut found = Table::new();
        if let Some(cell) = &self.cell {
            let mut robot = Table::new();
            robot.insert("base_position_mm".into(), values(&cell.base_position_mm)?);
            robot.insert("base_rpy_deg".into(), values(&cell.base_rpy_deg)?);
            found.insert("robot".into(), robot.into());
            let mut start = Table::new();
            start.insert("joints_deg".into(), values(&cell.start_joints_deg)?);
            found.insert("start".into(), start.into());
        }
        let mut controller = Table::new();
        if let Some(servo) = &self.servo {
            let (kp, kd) = (&servo.stiffness_nm_rad, &servo.damping_nms_rad);
            controller.insert("stiffness_nm_rad".into(), values(kp)?);
            controller.insert("damping_nms_rad".into(), values(kd)?);
        }
        if let Some(rotors) = &self.rotors {
            controller.insert("armature_kgm2".into(), values(&rotors.inertia_kgm2)?);
        }
        found.insert("controller".into(), controller.into());
        let mut test = Table::new();
        if let Some(cube) = &self.iso9283 {
            test.insert("cube_centre_mm".into(), values(&cube.cube_centre_mm)?);
            test.insert("cube_edge_mm".into(), cube.cube_edge_mm.into());
        }
        if let Some(payload) = &self.payload {
            test.insert("load_kg".into(), payload.kg.into());
        }
        if let Some(speed) = &self.tool_speed {
            test.insert("tool_speed_mm_s".into(), speed.mm_s.into());
        }
        if let Some(repeatability) = &self.repeatability {
            test.insert("limit_band_mm".into(), repeatability.mm.into());
        }
        found.insert("iso9283".into(), test.into());
        let mut imperfections = Table::new();
        if let Some(gears) = &self.gears {
            let mut block = Table::new();
            block.insert("stiffness_nm_rad".into(), values(&gears.stiffness_nm_rad)?);
            imperfections.insert("elasticity".into(), block.into());
        }
        if let Some(friction) = &self.friction {
            let mut block = Table::try_from(friction)?;
            block.remove("source");
            imperfections.insert("friction".into(), block.into());
        }
        if let Some(control) = &self.control {
            let mut block = Table::new();
            block.insert("period_ms".into(), control.period_ms.into());
            imperfections.insert("control".into(), block.into());
        }
        found.insert("imperfections".into(), imperfections.into());
        Ok(found.into())
    }
}

fn values(numbers: &[f64]) -> Result<Value, toml::ser::Error> {
    Value::try_from(numbers)
}
