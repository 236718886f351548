// An OpenNI2 driver without hardware: plays raw frames from files below the real libOpenNI2.
//
// The folder named by the environment variable VIRTUAL_KINECT holds one folder a device, with
//   device.txt   `key value` lines, see DeviceConfig
//   color.raw    RGB888 frames one after the other, depth.raw (registered to colour) and depth_unregistered.raw uint16 mm
//   plugged      the device is connected while this file exists
//   busy, forbidden, starved   while they exist: opening fails as a claimed or forbidden USB device does, streams start
//                but no frame arrives, as on a USB controller without bandwidth
//   starved_color, starved_depth   the same of one stream only
//   settings.txt written by the driver: what the application has set
// and, beside these folders, may hold watch_ms: how often the driver looks which devices are plugged in.
//
// The camera's time runs on through unplugging, as the world before a real camera does. With `loop 1` frames are
// played forwards and backwards for ever, so that the motion stays continuous.

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <dirent.h>
#include <fstream>
#include <map>
#include <memory>
#include <mutex>
#include <random>
#include <sstream>
#include <string>
#include <thread>
#include <unistd.h>
#include <vector>

#include "Driver/OniDriverAPI.h"

namespace virtual_kinect {

using Clock = std::chrono::steady_clock;
using oni::driver::DeviceBase;
using oni::driver::StreamBase;

bool exists(const std::string& path) { return access(path.c_str(), F_OK) == 0; }

struct DeviceConfig {
    std::string uri, serial = "VK0001";
    int width = 640, height = 480, fps = 30, frames = 0, loop = 0, registration = 1;
    int hotplug = 1;                                      // 0: as libfreenect's driver, devices are listed at its start only
    int tellsSerial = 1;
    double horizontalFov = 1.0226, verticalFov = 0.7966;  // radians
    double driftPpm = 0;                                  // of the device's clock against the host's
    double ticksPerMicrosecond = 1;                       // the unit of the time stamps
    int stampBits = 64;                                   // they wrap beyond
    long long firstStampUs = 1000000, depthOffsetUs = 0, jitterUs = 0;

    explicit DeviceConfig(const std::string& folder) {
        std::map<std::string, std::string> values;
        std::ifstream file(folder + "/device.txt");
        for (std::string key, value; file >> key >> value;) values[key] = value;
        auto read = [&](const char* key, auto& target) {
            auto found = values.find(key);
            if (found != values.end()) std::istringstream(found->second) >> target;
        };
        read("uri", uri); read("serial", serial);
        read("width", width); read("height", height); read("fps", fps); read("frames", frames);
        read("loop", loop); read("registration", registration);
        read("hotplug", hotplug); read("tells_serial", tellsSerial);
        read("horizontal_fov", horizontalFov); read("vertical_fov", verticalFov);
        read("drift_ppm", driftPpm); read("ticks_per_microsecond", ticksPerMicrosecond); read("stamp_bits", stampBits);
        read("first_stamp_us", firstStampUs); read("depth_offset_us", depthOffsetUs); read("jitter_us", jitterUs);
    }
};

class Device;

class Stream : public StreamBase {
  public:
    Stream(Device& device, OniSensorType type);
    ~Stream() override { stop(); }
    OniStatus start() override;
    void stop() override;
    OniBool isPropertySupported(int id) override;
    OniStatus getProperty(int id, void* data, int* size) override;
    OniStatus setProperty(int id, const void* data, int size) override;
    void notifyAllProperties() override;
    void play(long long tick, Clock::time_point due);

    std::atomic<bool> running{false};

  private:
    template <class T> OniStatus give(const T& value, void* data, int* size) {
        if (*size < static_cast<int>(sizeof(T))) return ONI_STATUS_BAD_PARAMETER;
        std::memcpy(data, &value, sizeof(T));
        *size = sizeof(T);
        return ONI_STATUS_OK;
    }
    int bytesPerPixel() const { return type_ == ONI_SENSOR_COLOR ? 3 : 2; }

    Device& device_;
    OniSensorType type_;
    OniVideoMode mode_;
    OniCropping cropping_{};
    OniBool mirror_ = TRUE, autoExposure_ = TRUE, autoWhiteBalance_ = TRUE;  // as a real device starts
    int frameIndex_ = 0;
};

class Device : public DeviceBase {
  public:
    explicit Device(const std::string& folder) : folder(folder), config(folder) {
        for (auto type : {ONI_SENSOR_COLOR, ONI_SENSOR_DEPTH}) {
            auto format = type == ONI_SENSOR_COLOR ? ONI_PIXEL_FORMAT_RGB888 : ONI_PIXEL_FORMAT_DEPTH_1_MM;
            auto& modes = modes_[type];
            modes.push_back({format, config.width, config.height, config.fps});
            modes.push_back({format, config.width / 2, config.height / 2, config.fps});
            modes.push_back({format, config.width / 2, config.height / 2, 2 * config.fps});
        }
    }

    OniStatus getSensorInfoList(OniSensorInfo** infos, int* count) override {
        sensorInfos_ = {{ONI_SENSOR_COLOR, 3, modes_[ONI_SENSOR_COLOR].data()},
                        {ONI_SENSOR_DEPTH, 3, modes_[ONI_SENSOR_DEPTH].data()}};
        *infos = sensorInfos_.data();
        *count = 2;
        return ONI_STATUS_OK;
    }

    StreamBase* createStream(OniSensorType type) override {
        if (type != ONI_SENSOR_COLOR && type != ONI_SENSOR_DEPTH) return nullptr;
        auto* stream = new Stream(*this, type);
        std::lock_guard<std::mutex> lock(mutex_);
        streams_.push_back(stream);
        return stream;
    }

    void destroyStream(StreamBase* stream) override {
        {
            std::lock_guard<std::mutex> lock(mutex_);
            for (auto it = streams_.begin(); it != streams_.end(); ++it)
                if (*it == stream) { streams_.erase(it); break; }
        }
        delete stream;
    }

    OniBool isPropertySupported(int id) override {
        return (id == ONI_DEVICE_PROPERTY_SERIAL_NUMBER && config.tellsSerial) ||
               (id == ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION && config.registration);
    }
    OniStatus getProperty(int id, void* data, int* size) override {
        if (id == ONI_DEVICE_PROPERTY_SERIAL_NUMBER && config.tellsSerial) {
            std::snprintf(static_cast<char*>(data), *size, "%s", config.serial.c_str());
            return ONI_STATUS_OK;
        }
        if (id == ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION && config.registration) {
            *static_cast<int*>(data) = registered;
            return ONI_STATUS_OK;
        }
        return ONI_STATUS_NOT_SUPPORTED;
    }
    OniStatus setProperty(int id, const void* data, int) override {
        if (id != ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION || !config.registration) return ONI_STATUS_NOT_SUPPORTED;
        registered = *static_cast<const int*>(data) == ONI_IMAGE_REGISTRATION_DEPTH_TO_COLOR;
        note("image_registration", registered);
        return ONI_STATUS_OK;
    }
    OniBool isImageRegistrationModeSupported(OniImageRegistrationMode mode) override {
        return mode == ONI_IMAGE_REGISTRATION_OFF || config.registration;
    }

    void note(const std::string& key, long long value) {
        std::lock_guard<std::mutex> lock(notesMutex_);
        notes_[key] = value;
        std::ofstream file(folder + "/settings.txt");
        for (auto& [name, set] : notes_) file << name << ' ' << set << '\n';
    }

    // The camera's thread runs while the device is plugged in; `epoch` outlives it.
    void begin(Clock::time_point epoch) {
        playing_ = true;
        thread_ = std::thread([this, epoch] { playFrom(epoch); });
    }
    void end() {
        playing_ = false;
        if (thread_.joinable()) thread_.join();
    }
    ~Device() override { end(); }

    bool fill(OniSensorType type, long long tick, std::vector<char>& pixels) {
        long long count = config.frames, index = tick;
        if (config.loop && count > 1) {
            index = tick % (2 * count - 2);
            if (index >= count) index = 2 * count - 2 - index;
        }
        if (index >= count) return false;
        const char* name = type == ONI_SENSOR_COLOR ? "/color.raw" : registered || !exists(folder + "/depth_unregistered.raw")
                                                                        ? "/depth.raw" : "/depth_unregistered.raw";
        std::ifstream file(folder + name, std::ios::binary);
        file.seekg(index * static_cast<long long>(pixels.size()));
        return static_cast<bool>(file.read(pixels.data(), pixels.size()));
    }

    const std::string folder;
    const DeviceConfig config;
    std::atomic<bool> registered{false};
    std::atomic<long long> firstTick{-1};
    double bootUs = 0;

  private:
    void playFrom(Clock::time_point epoch) {
        // At 2 fps so that the fast half-size mode is played too; full modes take every second tick.
        const auto period = std::chrono::nanoseconds(1000000000LL / (2 * config.fps));
        auto tick = (Clock::now() - epoch) / period + 1;
        auto played = Clock::now() - period;
        while (playing_) {
            // When this machine was late the frames follow no faster than a USB 2 bus could carry them.
            const auto due = epoch + tick * period;
            std::this_thread::sleep_until(std::max(due, played + period * 4 / 5));
            played = Clock::now();
            if (!exists(folder + "/starved")) {
                std::lock_guard<std::mutex> lock(mutex_);
                const auto running = std::count_if(streams_.begin(), streams_.end(), [](Stream* stream) { return stream->running.load(); });
                // The first frame is played once colour and depth both run; from then on the time goes its own way.
                if (firstTick < 0 && running == 2) firstTick = tick + tick % 2;
                if (firstTick >= 0 && tick >= firstTick)
                    for (auto* stream : streams_) stream->play(tick - firstTick, due);
            }
            ++tick;
        }
    }

    std::map<OniSensorType, std::vector<OniVideoMode>> modes_;
    std::vector<OniSensorInfo> sensorInfos_;
    std::vector<Stream*> streams_;
    std::mutex mutex_, notesMutex_;
    std::map<std::string, long long> notes_;
    std::atomic<bool> playing_{false};
    std::thread thread_;
};

Stream::Stream(Device& device, OniSensorType type) : device_(device), type_(type) {
    mode_ = {type == ONI_SENSOR_COLOR ? ONI_PIXEL_FORMAT_RGB888 : ONI_PIXEL_FORMAT_DEPTH_1_MM, device.config.width,
             device.config.height, device.config.fps};
}

OniStatus Stream::start() {
    running = true;
    return ONI_STATUS_OK;
}
void Stream::stop() { running = false; }

OniBool Stream::isPropertySupported(int id) {
    switch (id) {
        case ONI_STREAM_PROPERTY_VIDEO_MODE: case ONI_STREAM_PROPERTY_HORIZONTAL_FOV: case ONI_STREAM_PROPERTY_VERTICAL_FOV:
        case ONI_STREAM_PROPERTY_MIRRORING: case ONI_STREAM_PROPERTY_STRIDE: case ONI_STREAM_PROPERTY_CROPPING:
        case ONI_STREAM_PROPERTY_MAX_VALUE: case ONI_STREAM_PROPERTY_MIN_VALUE: return TRUE;
        case ONI_STREAM_PROPERTY_AUTO_EXPOSURE: case ONI_STREAM_PROPERTY_AUTO_WHITE_BALANCE: return type_ == ONI_SENSOR_COLOR;
        default: return FALSE;
    }
}

OniStatus Stream::getProperty(int id, void* data, int* size) {
    switch (id) {
        case ONI_STREAM_PROPERTY_VIDEO_MODE: return give(mode_, data, size);
        case ONI_STREAM_PROPERTY_HORIZONTAL_FOV: return give(static_cast<float>(device_.config.horizontalFov), data, size);
        case ONI_STREAM_PROPERTY_VERTICAL_FOV: return give(static_cast<float>(device_.config.verticalFov), data, size);
        case ONI_STREAM_PROPERTY_MIRRORING: return give(mirror_, data, size);
        case ONI_STREAM_PROPERTY_STRIDE: return give(mode_.resolutionX * bytesPerPixel(), data, size);
        case ONI_STREAM_PROPERTY_CROPPING: return give(cropping_, data, size);
        case ONI_STREAM_PROPERTY_MAX_VALUE: return give(type_ == ONI_SENSOR_COLOR ? 255 : 10000, data, size);
        case ONI_STREAM_PROPERTY_MIN_VALUE: return give(0, data, size);
        case ONI_STREAM_PROPERTY_AUTO_EXPOSURE: return give(autoExposure_, data, size);
        case ONI_STREAM_PROPERTY_AUTO_WHITE_BALANCE: return give(autoWhiteBalance_, data, size);
        default: return ONI_STATUS_NOT_SUPPORTED;
    }
}

OniStatus Stream::setProperty(int id, const void* data, int size) {
    const std::string prefix = type_ == ONI_SENSOR_COLOR ? "color_" : "depth_";
    switch (id) {
        case ONI_STREAM_PROPERTY_VIDEO_MODE: {
            if (size != static_cast<int>(sizeof mode_)) return ONI_STATUS_BAD_PARAMETER;
            std::memcpy(&mode_, data, sizeof mode_);
            break;
        }
        case ONI_STREAM_PROPERTY_CROPPING: std::memcpy(&cropping_, data, sizeof cropping_); return ONI_STATUS_OK;
        case ONI_STREAM_PROPERTY_MIRRORING:
            mirror_ = *static_cast<const OniBool*>(data);
            device_.note(prefix + "mirror", mirror_);
            break;
        case ONI_STREAM_PROPERTY_AUTO_EXPOSURE:
            autoExposure_ = *static_cast<const OniBool*>(data);
            device_.note(prefix + "auto_exposure", autoExposure_);
            break;
        case ONI_STREAM_PROPERTY_AUTO_WHITE_BALANCE:
            autoWhiteBalance_ = *static_cast<const OniBool*>(data);
            device_.note(prefix + "auto_white_balance", autoWhiteBalance_);
            break;
        default: return ONI_STATUS_NOT_SUPPORTED;
    }
    raisePropertyChanged(id, data, size);
    return ONI_STATUS_OK;
}

void Stream::notifyAllProperties() {
    // The recorder writes what is announced here into the .oni file's header.
    raisePropertyChanged(ONI_STREAM_PROPERTY_VIDEO_MODE, &mode_, sizeof mode_);
    const int stride = mode_.resolutionX * bytesPerPixel(), most = type_ == ONI_SENSOR_COLOR ? 255 : 10000, least = 0;
    const float horizontal = static_cast<float>(device_.config.horizontalFov), vertical = static_cast<float>(device_.config.verticalFov);
    raisePropertyChanged(ONI_STREAM_PROPERTY_STRIDE, &stride, sizeof stride);
    raisePropertyChanged(ONI_STREAM_PROPERTY_CROPPING, &cropping_, sizeof cropping_);
    raisePropertyChanged(ONI_STREAM_PROPERTY_HORIZONTAL_FOV, &horizontal, sizeof horizontal);
    raisePropertyChanged(ONI_STREAM_PROPERTY_VERTICAL_FOV, &vertical, sizeof vertical);
    raisePropertyChanged(ONI_STREAM_PROPERTY_MAX_VALUE, &most, sizeof most);
    raisePropertyChanged(ONI_STREAM_PROPERTY_MIN_VALUE, &least, sizeof least);
    raisePropertyChanged(ONI_STREAM_PROPERTY_MIRRORING, &mirror_, sizeof mirror_);
}

void Stream::play(long long tick, Clock::time_point due) {
    const auto& config = device_.config;
    if (!running) return;
    if (mode_.fps <= config.fps) {
        if (tick % 2) return;
        tick /= 2;
    }
    const int pixel = bytesPerPixel();
    std::vector<char> pixels(static_cast<size_t>(config.width) * config.height * pixel);
    if (exists(device_.folder + (type_ == ONI_SENSOR_COLOR ? "/starved_color" : "/starved_depth"))) return;
    if (!device_.fill(type_, tick, pixels)) return;
    if (config.jitterUs) {
        thread_local std::mt19937 random(7);
        std::this_thread::sleep_for(std::chrono::microseconds(random() % config.jitterUs));
    }
    OniFrame* frame = getServices().acquireFrame();
    if (!frame) return;
    const int step = config.width / mode_.resolutionX;
    frame->width = mode_.resolutionX;
    frame->height = mode_.resolutionY;
    frame->stride = mode_.resolutionX * pixel;
    frame->dataSize = frame->stride * frame->height;
    if (step == 1 && !mirror_) std::memcpy(frame->data, pixels.data(), pixels.size());
    else for (int row = 0; row < frame->height; ++row)
        for (int column = 0; column < frame->width; ++column) {
            const int shown = mirror_ ? frame->width - 1 - column : column;
            std::memcpy(static_cast<char*>(frame->data) + row * frame->stride + shown * pixel,
                        pixels.data() + (static_cast<size_t>(row) * step * config.width + column * step) * pixel, pixel);
        }
    const double hostUs = std::chrono::duration<double, std::micro>(due.time_since_epoch()).count();
    double bootUs = device_.bootUs;
    if (bootUs == 0) device_.bootUs = bootUs = hostUs;  // the clock starts anew with the power
    double deviceUs = config.firstStampUs + (hostUs - bootUs) * (1 + config.driftPpm * 1e-6);
    if (type_ == ONI_SENSOR_DEPTH) deviceUs += config.depthOffsetUs;
    auto ticks = static_cast<uint64_t>(std::llround(deviceUs * config.ticksPerMicrosecond));
    frame->timestamp = config.stampBits >= 64 ? ticks : ticks & ((1ULL << config.stampBits) - 1);
    frame->frameIndex = ++frameIndex_;
    frame->sensorType = type_;
    frame->videoMode = mode_;
    frame->croppingEnabled = FALSE;
    frame->cropOriginX = frame->cropOriginY = 0;
    raiseNewFrame(frame);
    getServices().releaseFrame(frame);
}

class Driver : public oni::driver::DriverBase {
  public:
    explicit Driver(OniDriverServices* services) : DriverBase(services) {}
    ~Driver() override { shutdown(); }

    OniStatus initialize(oni::driver::DeviceConnectedCallback connected, oni::driver::DeviceDisconnectedCallback disconnected,
                         oni::driver::DeviceStateChangedCallback changed, void* cookie) override {
        DriverBase::initialize(connected, disconnected, changed, cookie);
        const char* root = std::getenv("VIRTUAL_KINECT");
        if (!root) return ONI_STATUS_OK;
        if (DIR* directory = opendir(root)) {
            while (dirent* entry = readdir(directory)) {
                const std::string folder = std::string(root) + "/" + entry->d_name;
                if (entry->d_name[0] == '.' || !exists(folder + "/device.txt")) continue;
                folders_.push_back(folder);
                hotplug_[folder] = DeviceConfig(folder).hotplug;
            }
            closedir(directory);
        }
        int periodMs = 20;
        std::ifstream(std::string(root) + "/watch_ms") >> periodMs;
        watch(true);
        watching_ = true;
        watcher_ = std::thread([this, periodMs] {
            while (watching_) {
                std::this_thread::sleep_for(std::chrono::milliseconds(periodMs));
                watch(false);
            }
        });
        return ONI_STATUS_OK;
    }

    DeviceBase* deviceOpen(const char* uri, const char*) override {
        std::lock_guard<std::mutex> lock(mutex_);
        for (auto& [folder, connected] : connected_) {
            if (connected.info.uri != std::string(uri)) continue;
            if (!exists(folder + "/plugged")) break;
            if (exists(folder + "/forbidden")) {
                getServices().errorLoggerAppend("Could not open \"%s\": Failed to open the USB device!", uri);
                return nullptr;
            }
            if (exists(folder + "/busy")) {
                getServices().errorLoggerAppend("Could not open \"%s\": Failed to set USB interface!", uri);
                return nullptr;
            }
            auto* device = new Device(folder);
            device->firstTick = firstTicks_.count(folder) ? firstTicks_[folder] : -1;
            device->begin(epoch_);
            connected.device = device;
            return device;
        }
        getServices().errorLoggerAppend("Could not open \"%s\": USB device not found!", uri);
        return nullptr;
    }

    void deviceClose(DeviceBase* closing) override {
        auto* device = dynamic_cast<Device*>(closing);
        if (!device) return;
        std::lock_guard<std::mutex> lock(mutex_);
        device->end();
        firstTicks_[device->folder] = device->firstTick;
        for (auto& [folder, connected] : connected_)
            if (connected.device == device) connected.device = nullptr;
        // libfreenect's driver forgets a device that it has closed, though the library goes on listing it.
        if (!device->config.hotplug) connected_.erase(device->folder);
        delete device;
    }

    OniStatus tryDevice(const char*) override { return ONI_STATUS_ERROR; }

    void shutdown() override {
        watching_ = false;
        if (watcher_.joinable()) watcher_.join();
    }

  private:
    struct Connected {
        OniDeviceInfo info{};
        Device* device = nullptr;
    };

    void watch(bool atStart) {
        for (const auto& folder : folders_) {
            const bool plugged = exists(folder + "/plugged");
            OniDeviceInfo info{};
            bool arrived = false, left = false;
            {
                std::lock_guard<std::mutex> lock(mutex_);
                auto found = connected_.find(folder);
                if (!atStart && !hotplug_.at(folder)) {
                    if (!plugged && found != connected_.end() && found->second.device) found->second.device->end();
                } else if (plugged && found == connected_.end()) {
                    const DeviceConfig config(folder);
                    std::snprintf(info.uri, sizeof info.uri, "%s", config.uri.c_str());
                    std::snprintf(info.vendor, sizeof info.vendor, "This project");
                    std::snprintf(info.name, sizeof info.name, "Virtual Kinect");
                    info.usbVendorId = 0x045e;
                    info.usbProductId = 0x02ae;
                    connected_[folder].info = info;
                    arrived = true;
                } else if (!plugged && found != connected_.end()) {
                    info = found->second.info;
                    if (found->second.device) found->second.device->end();
                    connected_.erase(found);
                    left = true;
                }
            }
            if (arrived) { deviceConnected(&info); deviceStateChanged(&info, ONI_DEVICE_STATE_OK); }
            if (left) { deviceStateChanged(&info, ONI_DEVICE_STATE_ERROR); deviceDisconnected(&info); }
        }
    }

    static inline const Clock::time_point epoch_ = Clock::now();
    static inline std::map<std::string, long long> firstTicks_;  // outlive the library's shutdown
    std::vector<std::string> folders_;
    std::map<std::string, bool> hotplug_;
    std::map<std::string, Connected> connected_;
    std::mutex mutex_;
    std::atomic<bool> watching_{false};
    std::thread watcher_;
};

}  // namespace virtual_kinect

#define XN_NEW(type, argument) new type(argument)
#define XN_DELETE(pointer) delete pointer
ONI_EXPORT_DRIVER(virtual_kinect::Driver)
