//! The table of kernels: which buffers each one binds, and how many workgroups it gets. Bindings of group 0:
//! 0 is the step, 1 and up are the buffers in the order of the table, [`SORT_PASS_BINDING`] is the pass of the
//! sort. A test compares the table with the shaders.

/// A storage buffer of the backend. The shaders state the shape of each next to its binding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs, reason = "the shaders state the shape next to each binding")]
pub enum Buf {
    SplatP,
    SplatM,
    SplatV,
    SplatInfo,
    TexelP,
    TexelM,
    TexelV,
    TexelGrad,
    TexelValues,
    Statistics,
    Projected,
    Bounds,
    SplatSums,
    KeysA,
    ValuesA,
    KeysB,
    ValuesB,
    HistogramA,
    HistogramB,
    GroupLists,
    Visible,
    SlotOffsets,
    BlockSums,
    Slots,
    Pairs,
    TileRanges,
    Partials,
    Pixels,
    PixelState,
    PixelGrad,
    SsimMaps,
    LossMap,
    LossPartials,
    Photo,
    Status,
    Args,
    Sources,
    OldSplatInfo,
    OldValues,
    NewValues,
    Scales,
    MapChanges,
    Edits,
    Normals,
    Geometry,
    PixelRecords,
    GeometryPartials,
    ExposurePartials,
    SplatTotals,
    Costs,
}

impl Buf {
    /// The counterpart of a buffer that sort passes alternate between; other buffers are unchanged.
    pub fn swapped(self) -> Self {
        match self {
            Self::KeysA => Self::KeysB,
            Self::KeysB => Self::KeysA,
            Self::ValuesA => Self::ValuesB,
            Self::ValuesB => Self::ValuesA,
            Self::HistogramA => Self::HistogramB,
            Self::HistogramB => Self::HistogramA,
            other => other,
        }
    }
}

/// A storage binding of a kernel.
#[derive(Clone, Copy, Debug)]
pub struct Binding {
    /// Name of the variable in the shader.
    #[cfg_attr(
        not(test),
        allow(dead_code, reason = "only the tests compare names; bindings go by position")
    )]
    pub name: &'static str,
    /// Buffer bound by even sort passes; odd ones bind [`Buf::swapped`].
    pub buffer: Buf,
    /// Whether the access is `read_write`.
    pub writes: bool,
}

const fn read(name: &'static str, buffer: Buf) -> Binding {
    Binding { name, buffer, writes: false }
}

const fn write(name: &'static str, buffer: Buf) -> Binding {
    Binding { name, buffer, writes: true }
}

/// Numbers of workgroups: entries of the table of indirect dispatches. The host knows the first three before a
/// step; `visible_sums` writes the others once it has counted the pairs. If the pairs of a step do not fit, it
/// zeroes all entries, so that nothing that was submitted after it is applied; but the flush of that step is completed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u32)]
pub enum Groups {
    /// One workgroup.
    One,
    /// One invocation per splat.
    Splats,
    /// One workgroup per splat.
    EachSplat,
    /// One workgroup, once the pairs are counted.
    OneLater,
    /// One workgroup per block of [`super::shader::BLOCK`] visible splats, also if the pairs of this step do not fit.
    ListedBlocks,
    /// One workgroup per visible splat, also if the pairs of this step do not fit.
    EachListed,
    /// One workgroup per visible splat.
    EachVisible,
    /// One invocation per visible splat.
    Visible,
    /// One workgroup per block of [`super::shader::BLOCK`] visible splats.
    VisibleBlocks,
    /// Those of `sort_scan` for the keys of visible splats ([`super::sort::scan_groups`]).
    VisibleDigits,
    /// The same for the keys of pairs.
    PairDigits,
    /// One workgroup per tile of the rasterisation.
    Tiles,
    /// One workgroup per tile of the rasterisation, and per boundary between segments ([`super::segments`]).
    Segments,
    /// One workgroup per tile of the loss.
    LossTiles,
    /// One invocation per pair, and per tile of the rasterisation.
    PairsAndTiles,
    /// One workgroup per block of [`super::shader::BLOCK`] pairs.
    PairBlocks,
    /// One invocation per sum of a visible splat.
    VisibleTotals,
}

/// Entries of the table of indirect dispatches.
pub const NUM_GROUPS: u32 = Groups::VisibleTotals as u32 + 1;

/// Binding of the [`super::layout::SortPass`], in the kernels of the sort.
pub const SORT_PASS_BINDING: u32 = 15;

/// A kernel, or a variant of one.
#[derive(Clone, Copy, Debug)]
pub struct Kernel {
    /// Name of its file and of its entry point.
    pub name: &'static str,
    /// Preprocessor flags of the variant.
    pub flags: &'static [&'static str],
    /// Storage bindings 1, 2, ...
    pub bindings: &'static [Binding],
    /// Number of workgroups, unless a [`super::encode::Dispatch`] overrides it.
    pub groups: Groups,
}

/// Bindings of a kernel, and those that a variant adds.
macro_rules! bindings {
    ($([$($access:ident $binding:ident = $buffer:ident),* $(,)?])*) => {
        &[$($($access(stringify!($binding), Buf::$buffer)),*),*]
    };
}

/// Each kernel as `file, workgroups, [bindings] => { variant [flags] + [additional bindings]; ... }`.
macro_rules! kernels {
    ($($name:literal, $groups:ident, $base:tt => { $($id:ident $flags:tt $(+ $added:tt)?);* $(;)? })*) => {
        /// Index of a kernel variant in [`KERNELS`].
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[allow(missing_docs, reason = "named after their files and flags")]
        pub enum KernelId { $($($id),*),* }

        /// All kernels and their variants.
        pub const KERNELS: &[(KernelId, Kernel)] = &[$($((
            KernelId::$id,
            Kernel { name: $name, flags: &$flags, bindings: bindings!($base $($added)?), groups: Groups::$groups },
        )),*),*];
    };
}

kernels! {
    "project", Splats, [
        write splat_p = SplatP, write splat_m = SplatM, write splat_v = SplatV, read splat_info = SplatInfo,
        write projected = Projected, write bounds = Bounds, write group_lists = GroupLists,
    ] => {
        Project [];
        ProjectGeometry ["GEOMETRY"] + [write normals = Normals];
    }
    "flush_texel", EachListed, [
        write texel_p = TexelP, write texel_m = TexelM, write texel_v = TexelV, write texel_values = TexelValues,
        write splat_info = SplatInfo, read visible = Visible,
    ] => { FlushTexel [] }
    "flush_splat", EachSplat, [
        write splat_p = SplatP, write splat_m = SplatM, write splat_v = SplatV, read splat_info = SplatInfo,
    ] => { FlushSplat [] }
    "raster_fwd", Tiles, [
        read projected = Projected, write pairs = Pairs, read tile_ranges = TileRanges,
        read texel_values = TexelValues, write pixels = Pixels, write pixel_state = PixelState,
    ] => {
        RasterFwd [];
        RasterFwdCount ["COUNT", "ATOMIC_STATUS"] + [write status = Status];
        RasterFwdBatched ["BATCHED"];
        RasterFwdBatchedCount ["BATCHED", "COUNT", "ATOMIC_STATUS"] + [write status = Status];
        RasterFwdGeometry ["GEOMETRY"] + [read normals = Normals, write geometry = Geometry];
        RasterFwdBatchedGeometry ["BATCHED", "GEOMETRY"] + [read normals = Normals, write geometry = Geometry];
    }
    "raster_bwd", Tiles, [
        read projected = Projected, read pairs = Pairs, read tile_ranges = TileRanges,
        read texel_values = TexelValues, read pixel_state = PixelState, read pixel_grad = PixelGrad,
        write partials = Partials, write texel_grad = TexelGrad,
    ] => {
        RasterBwd [];
        RasterBwdStatistics ["STATISTICS"];
        RasterBwdScatter ["SCATTER"];
        RasterBwdStatisticsScatter ["STATISTICS", "SCATTER"];
        RasterBwdCount ["COUNT"];
        RasterBwdScatterCount ["SCATTER", "COUNT"];
    }
    // With GEOMETRY the state and gradient of a pixel are part of its record.
    "raster_bwd", Tiles, [
        read projected = Projected, read pairs = Pairs, read tile_ranges = TileRanges,
        read texel_values = TexelValues, read normals = Normals, read pixel_records = PixelRecords,
        write partials = Partials, write texel_grad = TexelGrad,
    ] => {
        RasterBwdGeometry ["STATISTICS", "GEOMETRY"];
        RasterBwdGeometryScatter ["STATISTICS", "GEOMETRY", "SCATTER"];
    }
    // The same by subgroups.
    "raster_bwd_subgroups", Segments, [
        read projected = Projected, read pairs = Pairs, read tile_ranges = TileRanges,
        read texel_values = TexelValues, read pixel_state = PixelState, read pixel_grad = PixelGrad,
        write partials = Partials, write texel_grad = TexelGrad,
    ] => {
        RasterBwdSubgroups ["SCATTER"];
        RasterBwdSubgroupsStatistics ["SCATTER", "STATISTICS"];
        RasterBwdSubgroupsCount ["SCATTER", "COUNT"];
    }
    "raster_bwd_subgroups", Tiles, [
        read projected = Projected, read pairs = Pairs, read tile_ranges = TileRanges,
        read texel_values = TexelValues, read normals = Normals, read pixel_records = PixelRecords,
        write partials = Partials, write texel_grad = TexelGrad,
    ] => { RasterBwdSubgroupsGeometry ["SCATTER", "STATISTICS", "GEOMETRY"] }
    "sum_pairs", VisibleTotals, [
        read bounds = Bounds, read partials = Partials, write splat_totals = SplatTotals, read visible = Visible,
        read slots = Slots,
    ] => { SumPairs [] }
    "project_bwd", Visible, [
        write splat_p = SplatP, write splat_m = SplatM, write splat_v = SplatV, read projected = Projected,
        write bounds = Bounds, read splat_totals = SplatTotals, write statistics = Statistics, read visible = Visible,
    ] => {
        ProjectBwd [];
        ProjectBwdGeometry ["GEOMETRY"];
    }
    "adam_texel", EachVisible, [
        write texel_p = TexelP, write texel_m = TexelM, write texel_v = TexelV, write texel_grad = TexelGrad,
        write texel_values = TexelValues, write splat_info = SplatInfo, write bounds = Bounds,
        read visible = Visible,
    ] => { AdamTexel [] }
    "prepare_probes", EachSplat, [
        write splat_p = SplatP, write splat_m = SplatM, write texel_p = TexelP, write texel_m = TexelM,
        write splat_info = SplatInfo,
    ] => { PrepareProbes [] }
    "probe_costs", EachVisible, [
        read splat_p = SplatP, write splat_m = SplatM, read texel_p = TexelP, write texel_m = TexelM,
        read splat_info = SplatInfo, write costs = Costs, read visible = Visible,
    ] => { ProbeCosts [] }
    "finish_blocks", Visible, [
        read bounds = Bounds, write splat_sums = SplatSums, read visible = Visible,
    ] => { FinishBlocks [] }
    "finish", OneLater, [
        read splat_sums = SplatSums, read loss_partials = LossPartials, write status = Status,
    ] => {
        Finish [];
        FinishGeometry ["GEOMETRY"] + [read geometry_partials = GeometryPartials];
    }
    "gather_splats", EachSplat, [
        read sources = Sources, read old_values = OldValues, write new_values = NewValues,
        read splat_info = SplatInfo, read old_info = OldSplatInfo,
    ] => { GatherSplats [] }
    "edit_splats", EachSplat, [
        read edits = Edits, write splat_p = SplatP, write splat_m = SplatM, read splat_info = SplatInfo,
    ] => { EditSplats [] }
    "regrid_maps", EachSplat, [
        read changes = MapChanges, read old_info = OldSplatInfo, write splat_info = SplatInfo,
        read old_values = OldValues, write new_values = NewValues, read scales = Scales,
    ] => { RegridMaps [] }
    "resample_maps", EachSplat, [
        read changes = MapChanges, read old_info = OldSplatInfo, read splat_info = SplatInfo,
        read old_values = OldValues, write new_values = NewValues, read scales = Scales,
    ] => { ResampleMaps [] }
    "exposure_fwd", LossTiles, [
        read photo = Photo, write pixels = Pixels, write exposure_partials = ExposurePartials,
    ] => { ExposureFwd [] }
    "exposure_bwd", LossTiles, [write pixel_grad = PixelGrad] => { ExposureBwd [] }
    "exposure_sums", OneLater, [
        read exposure_partials = ExposurePartials, write status = Status,
    ] => { ExposureSums [] }
    "loss_fwd", LossTiles, [
        read pixels = Pixels, read photo = Photo, write ssim_maps = SsimMaps, write loss_map = LossMap,
        write loss_partials = LossPartials,
    ] => { LossFwd [] }
    "loss_bwd", LossTiles, [
        read pixels = Pixels, read photo = Photo, read ssim_maps = SsimMaps, read loss_map = LossMap,
        write pixel_grad = PixelGrad,
    ] => { LossBwd [] }
    "geometry_loss", Tiles, [
        read geometry = Geometry, read pixel_state = PixelState, read tile_ranges = TileRanges,
        read photo = Photo, read pixel_grad = PixelGrad, write pixel_records = PixelRecords,
        write geometry_partials = GeometryPartials,
    ] => { GeometryLoss ["GEOMETRY"] }
    "visible_sums", One, [
        write status = Status, write group_lists = GroupLists, write args = Args, write visible = Visible,
    ] => { VisibleSums [] }
    "list_visible", ListedBlocks, [
        read status = Status, read group_lists = GroupLists, read bounds = Bounds, write keys_out = KeysA,
        write values_out = ValuesA, write histogram = HistogramA, write visible = Visible,
    ] => { ListVisible [] }
    "sort_scan", VisibleDigits, [
        read status = Status, write histogram = HistogramA, write next_histogram = HistogramB,
    ] => { SortScan [] }
    "sort_scatter", VisibleBlocks, [
        read status = Status, read histogram = HistogramA, write next_histogram = HistogramB, read keys_in = KeysA,
        read values_in = ValuesA, write keys_out = KeysB, write values_out = ValuesB,
    ] => { SortScatter [] }
    "prefix_blocks", VisibleBlocks, [
        read status = Status, read values_in = ValuesA, read bounds = Bounds, write slot_offsets = SlotOffsets,
        write block_sums = BlockSums,
    ] => { PrefixBlocks [] }
    "prefix_sums", OneLater, [read status = Status, write block_sums = BlockSums] => { PrefixSums [] }
    "tile_emit", PairBlocks, [
        read status = Status, read values_in = ValuesA, read slot_offsets = SlotOffsets, read block_sums = BlockSums,
        write bounds = Bounds, write keys_out = KeysA, write slots = Slots, write histogram = HistogramA,
    ] => { TileEmit [] }
    "gather_pairs", PairsAndTiles, [
        read status = Status, read keys_in = KeysB, read values_in = ValuesB, write slots = Slots,
        write pairs = Pairs, write ranges_out = TileRanges,
    ] => { GatherPairs [] }
}

impl Kernel {
    /// Whether it is dispatched directly, as one workgroup: it writes the table of indirect dispatches, and a
    /// dispatch must not read its own size from a buffer that it writes.
    pub fn is_direct(&self) -> bool {
        self.binds(Buf::Args)
    }

    /// Whether it binds a [`super::layout::SortPass`]: the kernels of the sort, which count for the next pass.
    pub fn has_sort_pass(&self) -> bool {
        self.binds(Buf::HistogramB)
    }

    /// Whether it computes depths, normals or the terms on them: compiled when first needed.
    pub fn is_geometry(&self) -> bool {
        self.flags.contains(&"GEOMETRY")
    }

    /// Whether it needs subgroups ([`super::form`] says who gets it).
    pub fn needs_subgroups(&self) -> bool {
        self.name.ends_with("_subgroups")
    }

    fn binds(&self, buffer: Buf) -> bool {
        self.bindings.iter().any(|binding| binding.buffer == buffer)
    }
}

impl KernelId {
    /// All kernels and variants, in the order of the table.
    pub fn all() -> impl Iterator<Item = Self> {
        KERNELS.iter().map(|(id, _)| *id)
    }

    /// The entry in the table.
    pub fn kernel(self) -> &'static Kernel {
        &KERNELS[self as usize].1
    }
}

/// The variants of the rasterisation that a backend uses.
#[derive(Clone, Copy, Debug)]
pub struct RasterKernels {
    /// Forward pass.
    pub fwd: KernelId,
    /// Backward pass.
    pub bwd: KernelId,
    /// Backward pass with window statistics.
    pub bwd_statistics: KernelId,
    /// Forward pass with depths and normals; never counts pairs.
    pub fwd_geometry: KernelId,
    /// Backward pass with the terms on depths and normals, and with window statistics.
    pub bwd_geometry: KernelId,
}

impl RasterKernels {
    /// The variants for hardware or software, the backward pass by subgroups or not, with or without counters for pairs and
    /// atomics.
    pub fn choose(hardware: bool, subgroups: bool, count_pairs: bool, count_texel_atomics: bool) -> Self {
        use KernelId as K;
        let fwd = match (hardware, count_pairs) {
            (false, false) => K::RasterFwd,
            (false, true) => K::RasterFwdCount,
            (true, false) => K::RasterFwdBatched,
            (true, true) => K::RasterFwdBatchedCount,
        };
        let fwd_geometry = if hardware { K::RasterFwdBatchedGeometry } else { K::RasterFwdGeometry };
        if subgroups {
            let bwd = if count_texel_atomics { K::RasterBwdSubgroupsCount } else { K::RasterBwdSubgroups };
            let (bwd_statistics, bwd_geometry) =
                (K::RasterBwdSubgroupsStatistics, K::RasterBwdSubgroupsGeometry);
            return Self { fwd, bwd, bwd_statistics, fwd_geometry, bwd_geometry };
        }
        let bwd = match (hardware, count_texel_atomics) {
            (false, false) => K::RasterBwd,
            (false, true) => K::RasterBwdCount,
            (true, false) => K::RasterBwdScatter,
            (true, true) => K::RasterBwdScatterCount,
        };
        let bwd_statistics = if hardware { K::RasterBwdStatisticsScatter } else { K::RasterBwdStatistics };
        let bwd_geometry = if hardware { K::RasterBwdGeometryScatter } else { K::RasterBwdGeometry };
        Self { fwd, bwd, bwd_statistics, fwd_geometry, bwd_geometry }
    }

    /// Kernels that depths and normals need in addition to [`Self::without_geometry`], for images or for training.
    pub fn geometry_only(&self, training: bool) -> Vec<KernelId> {
        use KernelId as K;
        let mut out = vec![K::ProjectGeometry, self.fwd_geometry];
        if training {
            out.extend([K::GeometryLoss, self.bwd_geometry, K::ProjectBwdGeometry, K::FinishGeometry]);
        }
        out
    }

    /// All kernels except those for depths and normals, with the chosen variants of the rasterisation.
    pub fn without_geometry(&self) -> Vec<KernelId> {
        let chosen = [self.fwd, self.bwd, self.bwd_statistics];
        let is_raster = |id: &KernelId| id.kernel().name.starts_with("raster_");
        KernelId::all()
            .filter(|id| !id.kernel().is_geometry() && (!is_raster(id) || chosen.contains(id)))
            .collect()
    }
}
