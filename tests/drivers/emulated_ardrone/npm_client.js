// npm's ar-drone flies an emulated drone: node npm_client.js PACKAGE HOST. One word a step.
const arDrone = require(process.argv[2]);
const client = arDrone.createClient({ip: process.argv[3]});
const say = (word) => process.stdout.write(word + '\n');

function until(what, holds) {
  return new Promise((resolve, reject) => {
    const timer = setTimeout(() => reject(new Error('waited in vain: ' + what)), 60000);
    const hear = (data) => {
      if (!holds(data)) return;
      clearTimeout(timer);
      client.removeListener('navdata', hear);
      say(what);
      resolve(data);
    };
    client.on('navdata', hear);
  });
}

const is = (state) => (data) => data.demo && data.demo.controlState === state;

async function fly() {
  await until('connected', (data) => data.droneState.navdataBootstrap === 0 && data.demo);
  client.config('general:navdata_demo', 'FALSE');
  await until('full', (data) => data.physMeasures && data.magneto && data.kalmanPressure);
  client.takeoff();
  await until('hovering', is('CTRL_HOVERING'));
  client.front(0.5);
  await until('forward', (data) => data.demo && data.demo.xVelocity > 200);
  client.stop();
  client.clockwise(0.5);
  const begun = client.lastHeading || 0;
  await until('turned', (data) => data.demo && Math.abs(data.demo.clockwiseDegrees - begun) > 20);
  client.stop();
  client.up(0.5);
  await until('climbed', (data) => data.demo && data.demo.altitudeMeters > 1.1);
  client.stop();
  client.land();
  await until('landed', is('CTRL_LANDED'));
  client.takeoff();
  await until('rising', (data) => data.demo && data.demo.altitudeMeters > 0.1);
  client._udpControl.ref({fly: true, emergency: true});
  client._udpControl.flush();
  client._ref.fly = false;
  await until('emergency', (data) => data.droneState.emergencyLanding === 1);
  await new Promise((resolve) => setTimeout(resolve, 1000));
  client.disableEmergency();
  await until('recovered', (data) => data.droneState.emergencyLanding === 0);
  client.takeoff();
  await until('flying again', is('CTRL_HOVERING'));
  client.land();
  await until('down', is('CTRL_LANDED'));
  process.exit(0);
}

fly().catch((error) => { console.error(error.message); process.exit(1); });
