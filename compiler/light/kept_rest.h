// The light of a field that is not direct light of entities, asked for again and again in one geometry: what the rays of a point met is kept from run to
// run (memo.h) and looked up in the light as it is now; and where that is what it was, what it was added up to. With LightField::arriving_direct it is the
// light of LightField::arriving.
#pragma once
#include "compiler/light/field.h"
#include "compiler/light/memo.h"
#include <type_traits>

namespace kiln {

class KeptRest {
public:
    KeptRest(const LightField& field, Memo* memo); // begun, by who ends it; none: nothing is kept
    // of_rays is called for each ray of the bundle, of_emitters for those that emitters get besides.
    using Arrivals = std::function<void(const Arrival& of_emitters, const Arrival& of_rays)>;
    // What add_up(Arrivals) makes of what arrives at `point`. `of`: all else that it is made from.
    template <class Sum, class AddUp> Sum sum(Vec3 point, Vec3 normal, std::uint32_t rays, std::uint64_t seed, std::uint64_t of, const AddUp& add_up) const {
        static_assert(std::is_trivially_copyable_v<Sum>);
        Sum out{};
        sum(point, normal, rays, seed, of, std::span(reinterpret_cast<std::uint8_t*>(&out), sizeof out), [&](const Arrivals& arrivals) { out = add_up(arrivals); });
        return out;
    }

private:
    void sum(Vec3 point, Vec3 normal, std::uint32_t rays, std::uint64_t seed, std::uint64_t of, std::span<std::uint8_t> out, const std::function<void(const Arrivals&)>& add_up) const;
    void note_changes();
    // Is all that the bundle (as it is kept) reads what it was in that light?
    bool unchanged(std::span<const std::uint8_t> bundle, std::uint64_t light) const;

    const LightField& field_;
    Memo* memo_;
    Box3 bounds_; // of the surfaces
    std::uint64_t shining_ = 0, emitters_ = 0;
    std::vector<std::uint64_t> states_;
    // The lights of all runs, each a hash of all states of light; per state, from which of them on it has been what it is.
    std::vector<std::uint64_t> lights_;
    std::vector<std::uint32_t> since_;
};

} // namespace kiln
