// A driver for OpenNI 2 whose device shows images from files, so that OpenNI's own recorder can write them down.
//
// Build it against the headers of OpenNI 2 (Debian: libopenni2-dev) and put it beside the library:
//   g++ -shared -fPIC -I/usr/include/openni2 openni_driver.cpp -o OpenNI2/Drivers/libscene.so.0
// make_openni.py does so, sets the environment that is read here, and records.

#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#define XN_NEW(type, ...) new type(__VA_ARGS__)
#define XN_DELETE(pointer) delete pointer
#include "Driver/OniDriverAPI.h"

namespace {

int number(const char* name) { return std::atoi(std::getenv(name)); }

class Stream : public oni::driver::StreamBase {
public:
    explicit Stream(bool depth) : depth(depth) {
        mode.pixelFormat = depth ? OniPixelFormat(number("SCENE_DEPTH_FORMAT")) : ONI_PIXEL_FORMAT_RGB888;
        mode.resolutionX = number("SCENE_WIDTH");
        mode.resolutionY = number("SCENE_HEIGHT");
        mode.fps = 30;
        std::ifstream file(std::getenv(depth ? "SCENE_DEPTH" : "SCENE_COLOUR"), std::ios::binary);
        images.assign(std::istreambuf_iterator<char>(file), {});
    }
    ~Stream() override { stop(); }

    OniStatus getProperty(int property, void* data, int* size) override {
        switch (property) {
        case ONI_STREAM_PROPERTY_VIDEO_MODE: return give(mode, data, size);
        case ONI_STREAM_PROPERTY_MAX_VALUE: return give(10000, data, size);
        case ONI_STREAM_PROPERTY_MIRRORING: return give(OniBool(number("SCENE_MIRRORED")), data, size);
        case ONI_STREAM_PROPERTY_HORIZONTAL_FOV: return give(float(std::atof(std::getenv("SCENE_HFOV"))), data, size);
        case ONI_STREAM_PROPERTY_VERTICAL_FOV: return give(float(std::atof(std::getenv("SCENE_VFOV"))), data, size);
        default: return ONI_STATUS_NOT_SUPPORTED;
        }
    }

    OniStatus start() override {
        running = true;
        thread = std::thread([this] { play(); });
        return ONI_STATUS_OK;
    }
    void stop() override {
        running = false;
        if (thread.joinable()) thread.join();
    }

private:
    template <class T> static OniStatus give(T value, void* data, int* size) {
        if (*size != int(sizeof(T))) return ONI_STATUS_BAD_PARAMETER;
        std::memcpy(data, &value, sizeof(T));
        return ONI_STATUS_OK;
    }

    void play() {
        const int bytes = mode.resolutionX * mode.resolutionY * (depth ? 2 : 3);
        std::this_thread::sleep_for(std::chrono::milliseconds(300));  // the recorder starts meanwhile
        for (int index = 0; running && (index + 1) * bytes <= int(images.size()); ++index) {
            OniFrame* frame = getServices().acquireFrame();
            std::memcpy(frame->data, images.data() + index * bytes, bytes);
            frame->dataSize = bytes;
            frame->sensorType = depth ? ONI_SENSOR_DEPTH : ONI_SENSOR_COLOR;
            frame->timestamp = 5000000ull + 100000ull * index / 3;
            frame->frameIndex = index + 1;
            frame->width = mode.resolutionX;
            frame->height = mode.resolutionY;
            frame->videoMode = mode;
            frame->croppingEnabled = FALSE;
            frame->cropOriginX = frame->cropOriginY = 0;
            frame->stride = bytes / mode.resolutionY;
            raiseNewFrame(frame);
            getServices().releaseFrame(frame);
            std::this_thread::sleep_for(std::chrono::milliseconds(30));
        }
    }

    const bool depth;
    OniVideoMode mode;
    std::vector<char> images;
    std::thread thread;
    volatile bool running = false;
};

class Device : public oni::driver::DeviceBase {
public:
    Device() {
        Stream depth(true), colour(false);
        int size = sizeof(OniVideoMode);
        depth.getProperty(ONI_STREAM_PROPERTY_VIDEO_MODE, &modes[0], &size);
        colour.getProperty(ONI_STREAM_PROPERTY_VIDEO_MODE, &modes[1], &size);
        sensors[0] = {ONI_SENSOR_DEPTH, 1, &modes[0]};
        sensors[1] = {ONI_SENSOR_COLOR, 1, &modes[1]};
    }
    OniStatus getSensorInfoList(OniSensorInfo** infos, int* count) override {
        *infos = sensors;
        *count = 2;
        return ONI_STATUS_OK;
    }
    oni::driver::StreamBase* createStream(OniSensorType type) override { return new Stream(type == ONI_SENSOR_DEPTH); }
    void destroyStream(oni::driver::StreamBase* stream) override { delete stream; }

private:
    OniVideoMode modes[2];
    OniSensorInfo sensors[2];
};

class Driver : public oni::driver::DriverBase {
public:
    explicit Driver(OniDriverServices* services) : DriverBase(services) {}
    OniStatus initialize(oni::driver::DeviceConnectedCallback connected,
                         oni::driver::DeviceDisconnectedCallback disconnected,
                         oni::driver::DeviceStateChangedCallback changed, void* cookie) override {
        DriverBase::initialize(connected, disconnected, changed, cookie);
        std::strcpy(info.uri, "scene");
        std::strcpy(info.vendor, "test");
        std::strcpy(info.name, "scene");
        deviceConnected(&info);
        return ONI_STATUS_OK;
    }
    oni::driver::DeviceBase* deviceOpen(const char*, const char*) override { return new Device(); }
    void deviceClose(oni::driver::DeviceBase* device) override { delete device; }
    void shutdown() override {}

private:
    OniDeviceInfo info = {};
};

}  // namespace

ONI_EXPORT_DRIVER(Driver)
