// The flow through one portal: what lines of sight that pass it can reach, chain of portals by chain of portals.
// Private to compiler/visibility.
#pragma once
#include "compiler/visibility/directed.h"
#include <functional>

namespace kiln::vis {

// Keeps the part of a convex winding in front of the plane, and the strip of `open` behind it. False, and `out`
// undefined, where no point lies in front by more than rounding.
bool clip(const std::vector<Vec3>& in, const Plane& plane, double open, std::vector<Vec3>& out);

// Planes with all of `source` behind and all of `pass` in front: whoever looks from source through pass sees only
// what lies in front of each.
void separators(const std::vector<Vec3>& source, const std::vector<Vec3>& pass, std::vector<Plane>& out);

// What may be seen through two portals one after the other: of each way p and each way q out of the cluster it leads to, the
// portals not hidden by the planes that separate the two whole windings. Known beforehand, it costs a chain an `and`.
class Passages {
public:
    // `most`: bytes; ways into clusters with the most ways out go without. Once `stop` says so, the rest is left as it is.
    Passages(std::span<const Directed> portals, const Exits& exits, const BitRows& reach, double epsilon, std::size_t most, const std::function<bool()>& stop, Context& context);
    // Of the k-th way out; null: not known, anything.
    const std::uint64_t* of(std::uint32_t p, std::size_t k) const { return first_[p] == kNone ? nullptr : rows_.row(first_[p] + k); }
    // Strikes from `reach` what is behind no passage, and what does not see back; again until nothing changes.
    void tighten(std::span<const Directed> portals, const Exits& exits, BitRows& reach, Context& context) const;

private:
    static constexpr std::size_t kNone = SIZE_MAX;
    std::vector<std::size_t> first_;
    BitRows rows_;
};

struct FlowInput {
    std::span<const Directed> portals;
    const Exits* exits;
    const BitRows* reach;               // per portal: final where `done`, else an upper bound
    const Passages* passages;
    double epsilon;                     // map units every clip leaves standing behind its plane
    const std::function<bool()>* stop;  // asked now and then: true ends it
};

enum class FlowEnd { done, over_budget, stopped };
// Adds the portals seen through p to `seen`. What is marked there beforehand need not be searched for; whether it is changes
// nothing of what is added. Not done: `seen` is unusable. `chain`: ends at the first that is added and says how it was reached.
FlowEnd flow(const FlowInput& input, std::uint32_t p, std::uint64_t step_budget, std::uint64_t* seen, std::uint64_t* steps, SightChain* chain = nullptr);

} // namespace kiln::vis
