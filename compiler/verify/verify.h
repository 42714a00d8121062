// Verify: every invariant of every geometric artefact, and the laws that tie one to the other, checked from the outside.
//
// In       what compile() made, or a level file
// Out      checks with their counts and findings (libs/core/checker.h); the codes are explained in
//          tools/kiln/explanations.inc
// Errors   none: whatever is wrong is a finding
//
// What a stage promises about its own tables is check_invariants() of that stage; here stand the laws that need other
// means: brute force over brushes, exact polytopes of leaves, closed surfaces, random points. A check that relies on
// another is not run where that failed. NOTES.md lists all, with what each is able to see.
#pragma once
#include "compiler/surfaces/surfaces.h"
#include "compiler/visibility/visibility.h"
#include "libs/core/checker.h"
#include <span>

namespace kiln {

struct VerifyOptions {
    std::size_t points = 20000; // random points for each check that draws some
    std::uint64_t seed = 1;
    double micro_gap = BspOptions{}.micro_gap; // that the tree was built with
};

void verify_document(const Document& document, Checker& checker);
void verify_world(const World& world, Checker& checker);
void verify_csg(const World& world, const Csg& csg, const VerifyOptions& options, Checker& checker);
// `filled`: built with BspOptions::fill.
void verify_bsp(const World& world, const Csg& csg, const Bsp& bsp, bool filled, const VerifyOptions& options, Checker& checker);
void verify_surfaces(const World& world, const Csg& csg, const Bsp& bsp, const Surfaces& surfaces, const VerifyOptions& options, Checker& checker);
void verify_visibility(const World& world, const Bsp& bsp, const Visibility& visibility, const VerifyOptions& options, Checker& checker);
// `name`: what findings call the file.
void verify_level(std::span<const std::uint8_t> bytes, const std::string& name, const VerifyOptions& options, Checker& checker);

} // namespace kiln
