#include "client/lib/client.h"

#include <chrono>
#include <random>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "btf/base/status_macros.h"
#include "client/lib/stubs.h"

namespace tessera {
namespace {

// A list answer carries each element's metadata; chunks are 1 MiB. Well above both.
constexpr int kLargestMessageBytes = 64 << 20;

// 128 random bits: who repeats a mutation with it gets the first answer again.
std::string NewRequestId() {
  std::random_device device;
  return absl::StrFormat("%08x%08x%08x%08x", device(), device(), device(), device());
}

template <class Request>
void FillRequestId(Request& request) {
  if (request.request_id().empty()) {
    request.set_request_id(NewRequestId());
  }
}

// HOST:PORT with both parts present; gRPC would take any scheme and a missing port.
bool IsAddress(const std::string& address) {
  const size_t colon = address.rfind(':');
  if (colon == std::string::npos || colon == 0 || address.find('/') != std::string::npos) {
    return false;
  }
  const std::string port = address.substr(colon + 1);
  return !port.empty() && port.size() <= 5 && port.find_first_not_of("0123456789") == std::string::npos &&
         std::stoi(port) >= 1 && std::stoi(port) <= 65535;
}

// Gathers every page of a list call.
template <class Item, class Request, class Call, class Items>
absl::StatusOr<std::vector<Item>> GatherPages(Request request, const Call& call, const Items& items_of) {
  std::vector<Item> all;
  while (true) {
    TESSERA_ASSIGN_OR_RETURN(auto response, call(request));
    for (auto& item : *items_of(response)) {
      all.push_back(std::move(item));
    }
    if (response.next_page_token().empty()) {
      return all;
    }
    request.set_page_token(response.next_page_token());
  }
}

}  // namespace

Client::Client(ClientOptions options, std::unique_ptr<Stubs> stubs)
    : options_(std::move(options)), stubs_(std::move(stubs)) {}

Client::~Client() = default;

absl::StatusOr<std::unique_ptr<Client>> Client::Connect(ClientOptions options, const RunContext& context) {
  if (!IsAddress(options.address)) {
    return absl::InvalidArgumentError(
        absl::StrCat("server address \"", options.address, "\": expected HOST:PORT with PORT 1 to 65535"));
  }
  if (options.cache_folder.empty()) {
    options.cache_folder = DefaultCacheFolder();
  }
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(kLargestMessageBytes);
  // gRPC's own reconnection must not wait longer than ours, or every attempt of ours would fail unheard.
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, options.retry.first_wait_ms);
  // In spite of its name the time that one attempt to connect may take.
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, options.connect_timeout_ms);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, options.retry.longest_wait_ms);
  const std::shared_ptr<grpc::Channel> channel =
      grpc::CreateCustomChannel(options.address, grpc::InsecureChannelCredentials(), arguments);

  const auto deadline =
      std::chrono::system_clock::now() + std::chrono::milliseconds(options.connect_timeout_ms);
  constexpr auto kStopInterval = std::chrono::milliseconds(50);
  grpc_connectivity_state state = channel->GetState(/*try_to_connect=*/true);
  while (state != GRPC_CHANNEL_READY) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    const auto now = std::chrono::system_clock::now();
    if (state == GRPC_CHANNEL_TRANSIENT_FAILURE || state == GRPC_CHANNEL_SHUTDOWN || now >= deadline) {
      return absl::UnavailableError(absl::StrCat("no server at ", options.address));
    }
    channel->WaitForStateChange(state, std::min(deadline, now + kStopInterval));
    state = channel->GetState(true);
  }
  auto stubs = std::make_unique<Stubs>(channel);
  return std::unique_ptr<Client>(new Client(std::move(options), std::move(stubs)));
}

absl::StatusOr<v1::ServerStatus> Client::GetServerStatus(const RunContext& context) {
  return CallUnary(*stubs_->server_info, &v1::ServerInfo::Stub::GetServerStatus, v1::GetServerStatusRequest(),
                   options_.retry, context);
}

absl::StatusOr<v1::Material> Client::CreateMaterial(v1::CreateMaterialRequest request,
                                                    const RunContext& context) {
  FillRequestId(request);
  return CallUnary(*stubs_->materials, &v1::Materials::Stub::CreateMaterial, request, options_.retry,
                   context);
}

absl::StatusOr<v1::Job> Client::ImportMaterial(v1::ImportMaterialRequest request, const RunContext& context) {
  FillRequestId(request);
  return Asked(
      CallUnary(*stubs_->materials, &v1::Materials::Stub::ImportMaterial, request, options_.retry, context),
      request.request_id());
}

absl::StatusOr<v1::Job> Client::GenerateMaterial(v1::GenerateMaterialRequest request,
                                                 const RunContext& context) {
  FillRequestId(request);
  return Asked(
      CallUnary(*stubs_->materials, &v1::Materials::Stub::GenerateMaterial, request, options_.retry, context),
      request.request_id());
}

absl::StatusOr<v1::Material> Client::GetMaterial(std::string_view name, const RunContext& context) {
  v1::GetMaterialRequest request;
  request.set_name(std::string(name));
  return CallUnary(*stubs_->materials, &v1::Materials::Stub::GetMaterial, request, options_.retry, context);
}

absl::StatusOr<std::vector<v1::Material>> Client::ListMaterials(const RunContext& context) {
  return GatherPages<v1::Material>(
      v1::ListMaterialsRequest(),
      [&](const v1::ListMaterialsRequest& request) {
        return CallUnary(*stubs_->materials, &v1::Materials::Stub::ListMaterials, request, options_.retry,
                         context);
      },
      [](v1::ListMaterialsResponse& response) { return response.mutable_materials(); });
}

absl::Status Client::DeleteMaterial(std::string_view name, const RunContext& context) {
  v1::DeleteMaterialRequest request;
  request.set_name(std::string(name));
  FillRequestId(request);
  return CallUnary(*stubs_->materials, &v1::Materials::Stub::DeleteMaterial, request, options_.retry, context)
      .status();
}

absl::StatusOr<v1::Arrangement> Client::GetArrangement(std::string_view name, const RunContext& context) {
  v1::GetArrangementRequest request;
  request.set_name(std::string(name));
  return CallUnary(*stubs_->arrangements, &v1::Arrangements::Stub::GetArrangement, request, options_.retry,
                   context);
}

absl::StatusOr<std::vector<v1::Arrangement>> Client::ListArrangements(const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(v1::ListArrangementsResponse response,
                           CallUnary(*stubs_->arrangements, &v1::Arrangements::Stub::ListArrangements,
                                     v1::ListArrangementsRequest(), options_.retry, context));
  return std::vector<v1::Arrangement>(response.arrangements().begin(), response.arrangements().end());
}

absl::StatusOr<v1::Job> Client::SynthesizeTileSet(v1::SynthesizeTileSetRequest request,
                                                  const RunContext& context) {
  FillRequestId(request);
  return Asked(
      CallUnary(*stubs_->tile_sets, &v1::TileSets::Stub::SynthesizeTileSet, request, options_.retry, context),
      request.request_id());
}

absl::StatusOr<v1::Job> Client::CertifyTileSet(v1::CertifyTileSetRequest request, const RunContext& context) {
  FillRequestId(request);
  return Asked(
      CallUnary(*stubs_->tile_sets, &v1::TileSets::Stub::CertifyTileSet, request, options_.retry, context),
      request.request_id());
}

absl::StatusOr<v1::TileSet> Client::CreateTileSet(v1::CreateTileSetRequest request,
                                                  const RunContext& context) {
  FillRequestId(request);
  return CallUnary(*stubs_->tile_sets, &v1::TileSets::Stub::CreateTileSet, request, options_.retry, context);
}

absl::StatusOr<v1::TileSet> Client::GetTileSet(std::string_view name, const RunContext& context) {
  v1::GetTileSetRequest request;
  request.set_name(std::string(name));
  return CallUnary(*stubs_->tile_sets, &v1::TileSets::Stub::GetTileSet, request, options_.retry, context);
}

absl::StatusOr<std::vector<v1::TileSet>> Client::ListTileSets(std::string_view parent,
                                                              const RunContext& context) {
  v1::ListTileSetsRequest first;
  first.set_parent(std::string(parent));
  return GatherPages<v1::TileSet>(
      std::move(first),
      [&](const v1::ListTileSetsRequest& request) {
        return CallUnary(*stubs_->tile_sets, &v1::TileSets::Stub::ListTileSets, request, options_.retry,
                         context);
      },
      [](v1::ListTileSetsResponse& response) { return response.mutable_tile_sets(); });
}

absl::Status Client::DeleteTileSet(std::string_view name, const RunContext& context) {
  v1::DeleteTileSetRequest request;
  request.set_name(std::string(name));
  FillRequestId(request);
  return CallUnary(*stubs_->tile_sets, &v1::TileSets::Stub::DeleteTileSet, request, options_.retry, context)
      .status();
}

absl::StatusOr<v1::DressMeshResponse> Client::DressMesh(v1::DressMeshRequest request,
                                                        const RunContext& context) {
  return CallUnary(*stubs_->dressings, &v1::Dressings::Stub::DressMesh, request, options_.retry, context);
}

}  // namespace tessera
