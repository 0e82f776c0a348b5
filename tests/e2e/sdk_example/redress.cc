// Dresses a mesh once and re-dresses it with every tile set of its arrangement that the server has.
//
//   redress HOST:PORT MESH ARRANGEMENT       MESH: the name of a built-in shape
#include <chrono>
#include <cstdio>
#include <string>

#include <tessera/btf/base/status_macros.h>
#include <tessera/btf/codec/decoder.h>
#include <tessera/btf/wang/arrangement.h>
#include <tessera/btf/wang/dress.h>
#include <tessera/btf/wang/redress.h>
#include <tessera/btf/wang/shapes.h>
#include <tessera/client/lib/client.h>
#include <tessera/client/lib/names.h>

namespace {

absl::Status Run(const std::string& address, const std::string& shape, const std::string& arrangement_id) {
  TESSERA_ASSIGN_OR_RETURN(const auto client, tessera::Client::Connect({.address = address}));
  TESSERA_ASSIGN_OR_RETURN(const tessera::Arrangement* arrangement, tessera::FindArrangement(arrangement_id));
  TESSERA_ASSIGN_OR_RETURN(const tessera::QuadMesh mesh, tessera::BuiltinShape(shape));
  TESSERA_ASSIGN_OR_RETURN(const tessera::DressResult dressed,
                           tessera::DressMesh(mesh, *arrangement, {}, {}));
  TESSERA_ASSIGN_OR_RETURN(const std::string parent, tessera::FullArrangementName(arrangement_id));
  TESSERA_ASSIGN_OR_RETURN(const auto tile_sets, client->ListTileSets(parent));
  for (const tessera::v1::TileSet& listed : tile_sets) {
    TESSERA_ASSIGN_OR_RETURN(const tessera::TileSet tile_set, client->FetchTileSet(listed.name()));
    const auto begin = std::chrono::steady_clock::now();
    TESSERA_ASSIGN_OR_RETURN(const tessera::Binding binding, tessera::Redress(dressed.dressing, tile_set));
    const std::chrono::duration<double, std::milli> elapsed = std::chrono::steady_clock::now() - begin;

    // The reflectance of the first quad's first texel, lit and seen along the normal.
    TESSERA_ASSIGN_OR_RETURN(const auto decoder, tessera::MakeDecoder(tile_set.btfels));
    const uint32_t texel = binding.texels.front()[0];
    const Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
    const Eigen::Array3d rgb = decoder->Decode(tile_set.btfels.btfel(tessera::BtfelOfTexel(texel)), normal,
                                               normal, tessera::TurnsOfTexel(texel));
    std::printf("%s: %zu quads bound in %.3f ms, first texel %.4f %.4f %.4f\n",
                tessera::ShortName(listed.name()).c_str(), binding.texels.size(), elapsed.count(), rgb[0],
                rgb[1], rgb[2]);
  }
  return absl::OkStatus();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: redress HOST:PORT SHAPE ARRANGEMENT\n");
    return 2;
  }
  if (const absl::Status status = Run(argv[1], argv[2], argv[3]); !status.ok()) {
    std::fprintf(stderr, "redress: %s\n", status.ToString().c_str());
    return 1;
  }
  return 0;
}
