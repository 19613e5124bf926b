//! The table of kernels: which buffers each one binds, and how many workgroups it gets. Bindings of group 0:
//! 0 is the step, 1 and on are the buffers in the order of the table, [`SORT_PASS_BINDING`] the pass of the
//! sort. A test compares the table with the shaders.

/// A buffer of the backend.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs, reason = "documented by the shape beside each binding in the shaders")]
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
    Histogram,
    SlotOffsets,
    BlockSums,
    SlotSplat,
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
}

impl Buf {
    /// The other one of the two halves that a sort swaps; itself for every other buffer.
    pub fn swapped(self) -> Self {
        match self {
            Self::KeysA => Self::KeysB,
            Self::KeysB => Self::KeysA,
            Self::ValuesA => Self::ValuesB,
            Self::ValuesB => Self::ValuesA,
            other => other,
        }
    }
}

/// A storage binding: its name in the shader, its buffer, and whether the shader writes it.
#[derive(Clone, Copy, Debug)]
pub struct Binding {
    /// Name of the variable; the tests compare it with the shader.
    #[cfg_attr(not(test), allow(dead_code, reason = "bindings go by their place"))]
    pub name: &'static str,
    /// Buffer, before the sort's swap.
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

/// Who decides on the number of workgroups: entries of the table of indirect dispatches. Those of the first
/// kind are known before a step, the others follow from its number of pairs; all are zero once a step of the
/// same submission did not fit, so that nothing after it is applied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u32)]
pub enum Groups {
    /// One.
    One,
    /// An invocation per splat.
    Splats,
    /// A block of [`super::shader::BLOCK`] splats each.
    SplatBlocks,
    /// A workgroup per splat.
    EachSplat,
    /// One, after the pairs are known.
    OneLater,
    /// A workgroup per splat, after the pairs are known.
    EachSplatLater,
    /// An invocation per splat, after the pairs are known.
    SplatsLater,
    /// A workgroup per tile.
    Tiles,
    /// A workgroup per tile of the loss.
    LossTiles,
    /// An invocation per tile.
    TileInvocations,
    /// An invocation per pair.
    Pairs,
    /// A block of [`super::shader::BLOCK`] pairs each.
    PairBlocks,
}

/// Entries of the table of indirect dispatches.
pub const NUM_GROUPS: u32 = Groups::PairBlocks as u32 + 1;

/// Binding of the pass of the sort, in kernels that have one.
pub const SORT_PASS_BINDING: u32 = 15;

/// A kernel.
#[derive(Clone, Copy, Debug)]
pub struct Kernel {
    /// Name of its file and of its entry point.
    pub name: &'static str,
    /// Flags for the preprocessor.
    pub flags: &'static [&'static str],
    /// Storage bindings 1, 2, ...
    pub bindings: &'static [Binding],
    /// Workgroups.
    pub groups: Groups,
    /// Whether it binds the pass of the sort.
    pub has_sort_pass: bool,
}

macro_rules! kernels {
    ($($id:ident = $name:literal $flags:expr, $groups:ident, $sort:expr, [$($access:ident $binding:ident = $buffer:ident),* $(,)?];)*) => {
        /// Kernels by their index in [`KERNELS`].
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[allow(missing_docs, reason = "named after their files")]
        pub enum KernelId { $($id),* }

        /// All kernels and their variants.
        pub const KERNELS: &[(KernelId, Kernel)] = &[$((
            KernelId::$id,
            Kernel {
                name: $name,
                flags: $flags,
                bindings: &[$($access(stringify!($binding), Buf::$buffer)),*],
                groups: Groups::$groups,
                has_sort_pass: $sort,
            },
        )),*];
    };
}

kernels! {
    Project = "project" &[], Splats, false, [
        write splat_p = SplatP, write splat_m = SplatM, write splat_v = SplatV, read splat_info = SplatInfo,
        write projected = Projected, write bounds = Bounds, write keys_out = KeysA,
    ];
    FlushTexel = "flush_texel" &[], EachSplat, false, [
        write texel_p = TexelP, write texel_m = TexelM, write texel_v = TexelV, write texel_values = TexelValues,
        write splat_info = SplatInfo, read bounds = Bounds,
    ];
    FlushSplat = "flush_splat" &[], EachSplat, false, [
        write splat_p = SplatP, write splat_m = SplatM, write splat_v = SplatV, read splat_info = SplatInfo,
    ];
    RasterFwd = "raster_fwd" &[], Tiles, false, [
        read projected = Projected, write pairs = Pairs, read tile_ranges = TileRanges,
        read texel_values = TexelValues, write pixels = Pixels, write pixel_state = PixelState,
    ];
    RasterFwdCount = "raster_fwd" &["COUNT", "ATOMIC_STATUS"], Tiles, false, [
        read projected = Projected, write pairs = Pairs, read tile_ranges = TileRanges,
        read texel_values = TexelValues, write pixels = Pixels, write pixel_state = PixelState, write status = Status,
    ];
    RasterFwdBatched = "raster_fwd" &["BATCHED"], Tiles, false, [
        read projected = Projected, write pairs = Pairs, read tile_ranges = TileRanges,
        read texel_values = TexelValues, write pixels = Pixels, write pixel_state = PixelState,
    ];
    RasterFwdBatchedCount = "raster_fwd" &["BATCHED", "COUNT", "ATOMIC_STATUS"], Tiles, false, [
        read projected = Projected, write pairs = Pairs, read tile_ranges = TileRanges,
        read texel_values = TexelValues, write pixels = Pixels, write pixel_state = PixelState, write status = Status,
    ];
    RasterBwd = "raster_bwd" &[], Tiles, false, [
        read projected = Projected, read pairs = Pairs, read tile_ranges = TileRanges,
        read texel_values = TexelValues, read pixel_state = PixelState, read pixel_grad = PixelGrad,
        write partials = Partials, write texel_grad = TexelGrad,
    ];
    RasterBwdStatistics = "raster_bwd" &["STATISTICS"], Tiles, false, [
        read projected = Projected, read pairs = Pairs, read tile_ranges = TileRanges,
        read texel_values = TexelValues, read pixel_state = PixelState, read pixel_grad = PixelGrad,
        write partials = Partials, write texel_grad = TexelGrad,
    ];
    RasterBwdScatter = "raster_bwd" &["SCATTER"], Tiles, false, [
        read projected = Projected, read pairs = Pairs, read tile_ranges = TileRanges,
        read texel_values = TexelValues, read pixel_state = PixelState, read pixel_grad = PixelGrad,
        write partials = Partials, write texel_grad = TexelGrad,
    ];
    RasterBwdStatisticsScatter = "raster_bwd" &["STATISTICS", "SCATTER"], Tiles, false, [
        read projected = Projected, read pairs = Pairs, read tile_ranges = TileRanges,
        read texel_values = TexelValues, read pixel_state = PixelState, read pixel_grad = PixelGrad,
        write partials = Partials, write texel_grad = TexelGrad,
    ];
    RasterBwdCount = "raster_bwd" &["COUNT"], Tiles, false, [
        read projected = Projected, read pairs = Pairs, read tile_ranges = TileRanges,
        read texel_values = TexelValues, read pixel_state = PixelState, read pixel_grad = PixelGrad,
        write partials = Partials, write texel_grad = TexelGrad,
    ];
    RasterBwdScatterCount = "raster_bwd" &["SCATTER", "COUNT"], Tiles, false, [
        read projected = Projected, read pairs = Pairs, read tile_ranges = TileRanges,
        read texel_values = TexelValues, read pixel_state = PixelState, read pixel_grad = PixelGrad,
        write partials = Partials, write texel_grad = TexelGrad,
    ];
    ProjectBwd = "project_bwd" &[], EachSplatLater, false, [
        write splat_p = SplatP, write splat_m = SplatM, write splat_v = SplatV, read projected = Projected,
        write bounds = Bounds, read partials = Partials, write statistics = Statistics,
    ];
    AdamTexel = "adam_texel" &[], EachSplatLater, false, [
        write texel_p = TexelP, write texel_m = TexelM, write texel_v = TexelV, write texel_grad = TexelGrad,
        write texel_values = TexelValues, write splat_info = SplatInfo, write bounds = Bounds,
    ];
    FinishBlocks = "finish_blocks" &[], SplatsLater, false, [
        read projected = Projected, read bounds = Bounds, write splat_sums = SplatSums,
    ];
    Finish = "finish" &[], OneLater, false, [
        read splat_sums = SplatSums, read loss_partials = LossPartials, write status = Status,
    ];
    GatherSplats = "gather_splats" &[], EachSplat, false, [
        read sources = Sources, read old_values = OldValues, write new_values = NewValues,
    ];
    EditSplats = "edit_splats" &[], EachSplat, false, [
        read edits = Edits, write splat_p = SplatP, write splat_m = SplatM,
    ];
    RegridMaps = "regrid_maps" &[], EachSplat, false, [
        read changes = MapChanges, read old_info = OldSplatInfo, write splat_info = SplatInfo,
        read old_values = OldValues, write new_values = NewValues, read scales = Scales,
    ];
    ResampleMaps = "resample_maps" &[], EachSplat, false, [
        read changes = MapChanges, read old_info = OldSplatInfo, read splat_info = SplatInfo,
        read old_values = OldValues, write new_values = NewValues, read scales = Scales,
    ];
    LossFwd = "loss_fwd" &[], LossTiles, false, [
        read pixels = Pixels, read photo = Photo, write ssim_maps = SsimMaps, write loss_map = LossMap,
        write loss_partials = LossPartials,
    ];
    LossBwd = "loss_bwd" &[], LossTiles, false, [
        read pixels = Pixels, read photo = Photo, read ssim_maps = SsimMaps, read loss_map = LossMap,
        write pixel_grad = PixelGrad,
    ];
    SortCount = "sort_count" &[], SplatBlocks, true, [
        read status = Status, read keys_in = KeysA, write histogram = Histogram,
    ];
    SortScan = "sort_scan" &[], One, true, [read status = Status, write histogram = Histogram];
    SortScatter = "sort_scatter" &[], SplatBlocks, true, [
        read status = Status, read histogram = Histogram, read keys_in = KeysA, read values_in = ValuesA,
        write keys_out = KeysB, write values_out = ValuesB,
    ];
    PrefixBlocks = "prefix_blocks" &[], SplatBlocks, false, [
        read values_in = ValuesB, read bounds = Bounds, write slot_offsets = SlotOffsets,
        write block_sums = BlockSums,
    ];
    PrefixSums = "prefix_sums" &[], One, false, [
        write status = Status, write block_sums = BlockSums, write args = Args,
    ];
    TileEmit = "tile_emit" &[], SplatsLater, false, [
        read values_in = ValuesB, read slot_offsets = SlotOffsets, read block_sums = BlockSums,
        write bounds = Bounds, write keys_out = KeysA, write slot_splat = SlotSplat,
    ];
    TileRanges = "tile_ranges" &[], TileInvocations, false, [
        read status = Status, read keys_in = KeysB, write ranges_out = TileRanges,
    ];
    GatherPairs = "gather_pairs" &[], Pairs, false, [
        read status = Status, read values_in = ValuesB, read slot_splat = SlotSplat, write pairs = Pairs,
    ];
    ProjectGeometry = "project" &["GEOMETRY"], Splats, false, [
        write splat_p = SplatP, write splat_m = SplatM, write splat_v = SplatV, read splat_info = SplatInfo,
        write projected = Projected, write bounds = Bounds, write keys_out = KeysA, write normals = Normals,
    ];
    RasterFwdGeometry = "raster_fwd" &["GEOMETRY"], Tiles, false, [
        read projected = Projected, write pairs = Pairs, read tile_ranges = TileRanges,
        read texel_values = TexelValues, write pixels = Pixels, write pixel_state = PixelState,
        read normals = Normals, write geometry = Geometry,
    ];
    RasterFwdBatchedGeometry = "raster_fwd" &["BATCHED", "GEOMETRY"], Tiles, false, [
        read projected = Projected, write pairs = Pairs, read tile_ranges = TileRanges,
        read texel_values = TexelValues, write pixels = Pixels, write pixel_state = PixelState,
        read normals = Normals, write geometry = Geometry,
    ];
    GeometryLoss = "geometry_loss" &["GEOMETRY"], Tiles, false, [
        read geometry = Geometry, read pixel_state = PixelState, read tile_ranges = TileRanges,
        read photo = Photo, read pixel_grad = PixelGrad, write pixel_records = PixelRecords,
        write geometry_partials = GeometryPartials,
    ];
    RasterBwdGeometry = "raster_bwd" &["STATISTICS", "GEOMETRY"], Tiles, false, [
        read projected = Projected, read pairs = Pairs, read tile_ranges = TileRanges,
        read texel_values = TexelValues, read normals = Normals, read pixel_records = PixelRecords,
        write partials = Partials, write texel_grad = TexelGrad,
    ];
    RasterBwdGeometryScatter = "raster_bwd" &["STATISTICS", "GEOMETRY", "SCATTER"], Tiles, false, [
        read projected = Projected, read pairs = Pairs, read tile_ranges = TileRanges,
        read texel_values = TexelValues, read normals = Normals, read pixel_records = PixelRecords,
        write partials = Partials, write texel_grad = TexelGrad,
    ];
    ProjectBwdGeometry = "project_bwd" &["GEOMETRY"], EachSplatLater, false, [
        write splat_p = SplatP, write splat_m = SplatM, write splat_v = SplatV, read projected = Projected,
        write bounds = Bounds, read partials = Partials, write statistics = Statistics,
    ];
    FinishGeometry = "finish" &["GEOMETRY"], OneLater, false, [
        read splat_sums = SplatSums, read loss_partials = LossPartials, write status = Status,
        read geometry_partials = GeometryPartials,
    ];
}

impl Kernel {
    /// Whether it is dispatched directly, as one workgroup: it writes the table of indirect dispatches, and no
    /// buffer may be written by a dispatch that reads its own size from it.
    pub fn is_direct(&self) -> bool {
        self.bindings.iter().any(|binding| binding.buffer == Buf::Args)
    }

    /// Whether it is there for depths, normals or the terms on them: compiled once one is asked for.
    pub fn is_geometry(&self) -> bool {
        self.flags.contains(&"GEOMETRY")
    }
}

impl KernelId {
    /// All of them.
    pub fn all() -> impl Iterator<Item = Self> {
        KERNELS.iter().map(|(id, _)| *id)
    }

    /// Its entry in the table.
    pub fn kernel(self) -> &'static Kernel {
        &KERNELS[self as usize].1
    }
}

/// Variants of the rasterisation that a backend uses.
#[derive(Clone, Copy, Debug)]
pub struct RasterKernels {
    /// Forward.
    pub fwd: KernelId,
    /// Backward.
    pub bwd: KernelId,
    /// Backward with window statistics.
    pub bwd_statistics: KernelId,
    /// Forward with depths and normals; pairs are not counted.
    pub fwd_geometry: KernelId,
    /// Backward with the terms on them, and with window statistics.
    pub bwd_geometry: KernelId,
}

impl RasterKernels {
    /// For hardware or software, with or without counted pairs and atomics.
    pub fn choose(hardware: bool, count_pairs: bool, count_texel_atomics: bool) -> Self {
        use KernelId as K;
        let fwd = match (hardware, count_pairs) {
            (false, false) => K::RasterFwd,
            (false, true) => K::RasterFwdCount,
            (true, false) => K::RasterFwdBatched,
            (true, true) => K::RasterFwdBatchedCount,
        };
        let bwd = match (hardware, count_texel_atomics) {
            (false, false) => K::RasterBwd,
            (false, true) => K::RasterBwdCount,
            (true, false) => K::RasterBwdScatter,
            (true, true) => K::RasterBwdScatterCount,
        };
        let bwd_statistics = if hardware { K::RasterBwdStatisticsScatter } else { K::RasterBwdStatistics };
        let (fwd_geometry, bwd_geometry) = if hardware {
            (K::RasterFwdBatchedGeometry, K::RasterBwdGeometryScatter)
        } else {
            (K::RasterFwdGeometry, K::RasterBwdGeometry)
        };
        Self { fwd, bwd, bwd_statistics, fwd_geometry, bwd_geometry }
    }

    /// What depths and normals need beside the rest: for an image, or for a step.
    pub fn geometry(&self, training: bool) -> Vec<KernelId> {
        use KernelId as K;
        let mut out = vec![K::ProjectGeometry, self.fwd_geometry];
        if training {
            out.extend([K::GeometryLoss, self.bwd_geometry, K::ProjectBwdGeometry, K::FinishGeometry]);
        }
        out
    }

    /// These without depths and normals, and every kernel that is not of the rasterisation.
    pub fn and_all_others(&self) -> Vec<KernelId> {
        let chosen = [self.fwd, self.bwd, self.bwd_statistics];
        let is_raster = |id: &KernelId| id.kernel().name.starts_with("raster_");
        KernelId::all()
            .filter(|id| !id.kernel().is_geometry() && (!is_raster(id) || chosen.contains(id)))
            .collect()
    }
}
