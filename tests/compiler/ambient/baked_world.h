// Worlds of the builder through all stages up to the light field.
#pragma once
#include "compiler/light/field.h"
#include "tests/support/world_builder.h"
#include <gtest/gtest.h>

namespace kiln::test {

struct Baked {
    World world;
    Csg csg;
    Bsp bsp;
    Surfaces surfaces;
    std::vector<Light> lights;
    Lighting lighting;
    Context context;
    std::unique_ptr<LightField> field;
};

inline std::unique_ptr<Baked> bake(const WorldBuilder& builder) {
    auto b = std::make_unique<Baked>();
    b->context.threads = 2;
    b->world = builder.world;
    const auto take = [](auto result, auto& into) {
        if (!result) ADD_FAILURE() << result.fault().diagnostic.message;
        else into = std::move(*result);
    };
    take(build_csg(b->world, {}, b->context), b->csg);
    take(build_bsp(b->world, b->csg, {}, b->context), b->bsp);
    take(build_surfaces(b->world, b->csg, b->bsp, {}, b->context), b->surfaces);
    b->lights = read_lights(b->world, b->context);
    take(bake_light(b->world, b->bsp, b->csg.planes, b->surfaces, b->lights, {}, b->context), b->lighting);
    b->field = std::make_unique<LightField>(b->world, b->bsp, b->csg.planes, b->surfaces, b->lights, b->lighting);
    return b;
}

} // namespace kiln::test
