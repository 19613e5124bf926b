// Where `group_lists` holds the visible splats of each group of GROUP splats: first the splats of each group, room for
// GROUP each; then the number of each group, which `visible_sums` replaces by that of all groups before; then their pairs.

fn splat_groups() -> u32 {
    return (step.num_splats + (GROUP - 1u)) / GROUP;
}

fn list_at(group: u32) -> u32 {
    return group * GROUP;
}

fn count_at(group: u32) -> u32 {
    return splat_groups() * GROUP + group;
}

fn pairs_at(group: u32) -> u32 {
    return splat_groups() * (GROUP + 1u) + group;
}
