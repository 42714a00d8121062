// Pictures from a level file alone, by the run-time formulas of formats/level: the view of a camera, atlas pages,
// false colours, a plan. What an engine would show, without one.
//
// In       an open level (kiln_level.h); textures are looked for in the directories the caller names
// Out      Image, RGB, linear; camera pictures hold radiance (write_exr), tone_mapped() makes them displayable
//          (write_png with Transfer::srgb, its default)
// Errors   fault `level-damaged` (Exit::input) where a part that is needed cannot be read; `no-such-page`
#pragma once
#include "formats/level/kiln_level.h"
#include "libs/core/context.h"
#include "libs/core/result.h"
#include "libs/image/image.h"
#include "libs/math/vec.h"
#include <string>
#include <string_view>
#include <vector>

namespace kiln {

struct Camera { // angles as in Source: yaw 0 looks along +x, 90 along +y; pitch 90 looks straight down
    Vec3 eye{};
    double yaw_deg = 0, pitch_deg = 0;
    double fov_deg = 90; // horizontal
};
// Where a player or a camera entity stands (point_viewcontrol, info_player_start and relatives, eye height added);
// else the middle of the largest room. Exactly the same for the same file.
Camera default_camera(const kiln_level* level);
Camera camera_looking_at(Vec3 eye, Vec3 target, double fov_deg = 90);

enum class Show : std::uint8_t {
    shaded,       // albedo, normal maps, lightmaps, emission, cubemap reflections
    irradiance,   // lightmaps with normal maps on white: radiance of a Lambertian reflector of albedo 1
    flat,         // lightmaps for the flat normal, without normal maps
    albedo,
    normals,      // world normal of the shading, 0.5 + 0.5 n
    reflection,   // what the cubemaps add
    luxels,       // luxel grid, coloured by size
    error,        // estimated relative error of each luxel
    validity,     // baked green, filled blue, outside red
    faces, clusters, probes, // a colour for each
};
struct CameraOptions {
    int width = 1280, height = 720;
    int samples = 4;              // per pixel, 1..64: rounded to a square
    Show show = Show::shaded;
    bool normal_maps = true;
    double fresnel_at_normal = 0.04; // F0 of Schlick's formula; reflection = env_map * F(cos) * cubemap
    bool own_sky = true;             // the level's own sky radiance where it has one
    Rgb sky{0.25f, 0.4f, 0.65f};     // otherwise, radiance
    std::vector<std::string> texture_directories = {}; // searched in order for the material's file names
};
// Materials whose files are not found show their reflectance; each missing name is reported once (note
// `texture-not-found`).
Result<Image> render_camera(const kiln_level* level, const Camera& camera, const CameraOptions& options,
                            Context& context);

// Exposure for a picture: 0.18 over its geometric mean luminance, held within a factor of the brightest 5 %.
double auto_exposure(const Image& radiance);
// exposure * radiance through a filmic curve (K. Narkowicz's fit of ACES, 2016) to linear display values in [0,1].
// exposure 0: automatic.
Image tone_mapped(const Image& radiance, double exposure = 0);

// All pages, one beneath the other, of one basis direction: layer 0..2; layer -1: the flat value everywhere. Flat pages
// show their one layer whatever is asked. Irradiance; signed values as they are.
Result<Image> render_atlas(const kiln_level* level, int layer);
Result<Image> render_atlas_page(const kiln_level* level, std::uint32_t page, int layer);

enum class FalseColour : std::uint8_t { luxel_density, error, validity };
Result<Image> render_false_colour(const kiln_level* level, FalseColour kind); // all pages, as render_atlas

struct PlanOptions {
    int width = 1024; // pixels; the height follows the level
    bool portals = true, entities = true;
    std::int32_t vis_from = -1; // a cluster: shows what it sees and hears instead of which cluster is which
};
// The leaves cut at a height: solid dark, clusters coloured, portals as lines, lights and probes as dots. With vis_from: that
// cluster yellow, what it may see green, what is seen from there (potentially audible) blue, the rest grey.
Result<Image> render_plan(const kiln_level* level, double z, const PlanOptions& options = {});
double default_plan_height(const kiln_level* level); // that of the default camera

} // namespace kiln
