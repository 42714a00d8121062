// The light of a field that is not direct light of entities, asked for again and again in one geometry: what the rays of a point met is kept from run to
// run (memo.h) and looked up in the light as it is now. With LightField::arriving_direct it is the light of LightField::arriving.
#pragma once
#include "compiler/light/field.h"
#include "compiler/light/memo.h"

namespace kiln {

class KeptRest {
public:
    KeptRest(const LightField& field, Memo* memo); // begun, by who ends it; none: nothing is kept
    // `of_rays` is called for each ray of the bundle, `of_emitters` for those that emitters get besides.
    void arriving(Vec3 point, Vec3 normal, std::uint32_t rays, std::uint64_t seed, const Arrival& of_emitters, const Arrival& of_rays) const;

private:
    const LightField& field_;
    Memo* memo_;
    std::uint64_t shining_ = 0, emitters_ = 0;
    std::vector<std::uint64_t> states_;
    std::uint64_t seen_of(const std::vector<Rgbd>& reflected) const { return shining_ ? mix(emitters_, hash_of(reflected).low) : 0; }
};

} // namespace kiln
