//! Limits on a vehicle's motion.

skein_bp::events! {
    /// What b-threads of a vehicle state, and nobody requests: it holds while the b-thread that states it stays where
    /// it is.
    pub const STATED;

    /// Keep to this in flight. Of several, the tightest bounds count; avoiding, landing and the way home outrank them
    /// all.
    Limit = "limit", Own {
        /// Slower ones cannot be told from a vehicle that is stuck.
        speed_m_s: Option<f64> ["m/s", 0.3..=f64::INFINITY],
        min_x: Option<f64> ["m"],
        min_y: Option<f64> ["m"],
        min_z: Option<f64> ["m"],
        max_x: Option<f64> ["m"],
        max_y: Option<f64> ["m"],
        max_z: Option<f64> ["m"],
    }
}

impl Limit {
    /// No limit at all, to begin with: `Limit { max_z: Some(4.0), ..Limit::NONE }`.
    pub const NONE: Self = Self {
        speed_m_s: None,
        min_x: None,
        min_y: None,
        min_z: None,
        max_x: None,
        max_y: None,
        max_z: None,
    };
}
