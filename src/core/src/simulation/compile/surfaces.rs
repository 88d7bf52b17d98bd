//! Gap functions of contact pairs, and the modes of surface carriers.

use super::{Compiled, MAX_COUPLED};
use crate::geometry::layout::Layout;
use crate::geometry::open::OpenGap;
use crate::geometry::surface_spline::SurfaceSpline;
use crate::geometry::{GapLaw, RevolutionGap};
use crate::modes::modal::ModalModel;
use crate::scene::ranges::SMALL;
use crate::scene::settings::Meridian;
use crate::scene::shape::CompiledShape;
use crate::simulation::contour::check_contour;
use crate::simulation::plan::PairPlan;
use crate::simulation::spline_surface::{CarrierModes, Lining, Share, spline_gap};
use crate::system::joined;
use crate::{Error, Result, Rom};

impl Compiled {
    /// Returns the lining between the surface of a pair and the mesh of its carrier, if the support is requested.
    pub(super) fn lining(&self, pair: usize) -> Result<Option<Lining>> {
        let plan = &self.plan.pairs[pair];
        let supported = |carrier: &usize| self.carriers[*carrier].support.is_some();
        let Some(carrier) = plan.carrier.filter(supported).filter(|_| plan.grid.is_none()) else { return Ok(None) };
        let master = (self.body(plan.body).1, &plan.nodes[..]);
        Lining::new(carrier, (self.carrier(carrier).1, self.share(carrier)), master, self.contact(pair)).map(Some)
    }

    /// Returns the part of the contact grid of a carrier that a surface uses.
    fn share(&self, carrier: usize) -> Share {
        if self.plan.pairs_on(carrier).count() > 1 { Share::Near } else { Share::Whole }
    }

    /// Checks that the number of contacts that are solved together is within the limit. These are the contacts of one
    /// structure, or of several structures that share a surface carrier.
    pub(super) fn check_size(&self) -> Result<()> {
        let (count, pairs) = (self.bodies.len(), self.plan.pairs.iter());
        let links = pairs.filter_map(|pair| Some((pair.body, count + pair.carrier?)));
        let set = joined(count + self.carriers.len(), links);
        let mut coupled = vec![0; set.len()];
        for (body, parts) in self.bodies.iter().enumerate() {
            let rom = self.body(body).1;
            let own: usize = self.plan.pairs_of(body).map(|(_, pair)| pair.nodes.len()).sum();
            let carried = self.plan.pairs_of(body).any(|(_, pair)| pair.carrier.is_some());
            if parts.disk.is_some() || parts.translations.is_some() || carried {
                coupled[set[body]] += own * rom.sectors;
            }
            let (together, name) = (coupled[set[body]], &self.body(body).0.name);
            if together <= MAX_COUPLED {
                continue;
            }
            let first = self.plan.pairs_of(body).next().map_or(0, |(pair, _)| pair);
            let (what, problem, remedy) = if parts.translations.is_some() {
                let problem = format!("{together} contact nodes in all pairs");
                ("contact.nodes", problem, "Choose fewer nodes, or a coarser mesh")
            } else {
                let what = if parts.disk.is_some() { "ROM metadata `sectors`" } else { "surface.structure" };
                let problem = format!("{together} coupled contact nodes in all sectors");
                (what, problem, "Use fewer contact nodes or sectors, or uncoupled sectors on a rigid surface")
            };
            let problem = format!("{problem} of `{name}` and the structures coupled to it, more than {MAX_COUPLED}");
            return Err(self.of_pair(first, Error::invalid(what, problem, remedy)));
        }
        Ok(())
    }

    /// Creates the gap function of a pair.
    pub(in crate::simulation) fn gap(&self, pair: usize) -> Result<GapLaw> {
        let plan = &self.plan.pairs[pair];
        if self.bodies[plan.body].translations.is_some() {
            return self.open_gap(plan);
        }
        let (contact, settings) = (self.contact(pair), self.plan.surface(&self.scene.settings, pair));
        let (structure, rom) = self.body(plan.body);
        let clearances =
            if contact.sector_gaps.is_empty() { vec![contact.gap; rom.sectors] } else { contact.sector_gaps.clone() };
        let surface = CompiledShape::new(&settings.shape, contact.nominal_gap())?;
        check_lengths(rom, &clearances, &surface)?;
        let lanes = crate::modes::bank::lanes(rom.sectors);
        let spline = settings.spline.is_some() || plan.carrier.is_some();
        if contact.meridian == Meridian::Contour {
            check_contour(rom, &plan.nodes, !spline)?;
        }
        if !spline {
            let gap = RevolutionGap::new(rom, surface, &clearances, contact.meridian, lanes)?;
            let gap = gap.of_nodes(plan.nodes.clone()).with_moving_shaft(structure.whirl || structure.axial_shift);
            return Ok(GapLaw::Revolution(gap));
        }
        let layout = Layout::new(rom, &clearances, lanes)?;
        let carrier = plan.carrier.map(|carrier| (self.carrier(carrier).1, self.share(carrier)));
        let gap = spline_gap((rom, &plan.nodes), layout, contact, settings, carrier)?;
        Ok(GapLaw::Spline(Box::new(gap)))
    }

    fn open_gap(&self, plan: &PairPlan) -> Result<GapLaw> {
        let rom = self.body(plan.body).1;
        let positions = rom.contact_nodes.iter().map(|node| node.position.into()).collect();
        let mut gap = OpenGap::new(positions, plan.nodes.clone(), self.open_surface(plan)?);
        for (_, other) in self.plan.pairs_of(plan.body) {
            gap = gap.beside(&self.open_surface(other)?);
        }
        Ok(GapLaw::Open(Box::new(gap)))
    }

    /// Creates the undeformed surface through an open contact grid.
    fn open_surface(&self, plan: &PairPlan) -> Result<SurfaceSpline> {
        let Some(rom) = plan.grid.map(|grid| &self.scene.roms[grid]) else { unreachable!("validated") };
        let Some(grid) = rom.extras.grid else { unreachable!("checked") };
        let data: Vec<[f64; 3]> = rom.contact_nodes.iter().map(|node| node.position).collect();
        let spline = self.scene.settings.surfaces[plan.surface].spline.unwrap_or_default();
        SurfaceSpline::open(&data, grid.around, grid.along, spline.interpolation)
    }

    /// Returns the modes of each carrier at the control points of its surfaces, one surface after the other.
    pub(super) fn control_modes(&self, gaps: &[GapLaw]) -> Vec<ModalModel> {
        let of = |index: usize| {
            let own = self.plan.pairs_on(index);
            let seen = own.filter_map(|(pair, _)| self.control_modes_of(index, &gaps[pair]));
            seen.reduce(ModalModel::seen_at_both)
        };
        (0..self.carriers.len()).filter_map(of).collect()
    }

    /// Returns the modes of a carrier at the control points of one surface; `None` for a surface without control points.
    pub(crate) fn control_modes_of(&self, carrier: usize, gap: &GapLaw) -> Option<ModalModel> {
        let first = if let GapLaw::Spline(gap) = gap { gap.first_node } else { 0 };
        let modes = CarrierModes { rom: self.carrier(carrier).1, model: &self.carriers[carrier].model };
        Some(modes.at_control_points(gap.spline()?, first))
    }
}

fn check_lengths(rom: &Rom, clearances: &[f64], surface: &CompiledShape) -> Result<()> {
    let smallest = rom.contact_nodes.iter().fold(f64::INFINITY, |low, node| low.min(node.position[0]));
    let largest_gap = clearances.iter().fold(0.0, |largest: f64, gap| largest.max(*gap));
    for (what, value) in [("contact.gap", largest_gap), ("surface.shape", surface.largest_change())] {
        if value > SMALL * smallest {
            return Err(Error::invalid(
                what,
                format!("{value:.3e} m is not small compared with the radius of the contact nodes, {smallest:.3e} m"),
                "Give lengths in metres, well below a tenth of the radius",
            ));
        }
    }
    Ok(())
}
