// The robot in three.js: links are groups, joints turn them, sliders or a flight set the angles.
(function () {
  const stage = document.getElementById("stage");
  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  } catch (error) {
    document.getElementById("hint").textContent = "This browser has no WebGL: the picture replaces the 3-D view.";
    return;
  }
  const scene = new THREE.Scene();
  scene.background = new THREE.Color(0xf4f7fa);
  const camera = new THREE.PerspectiveCamera(38, 1, 0.01, 200);
  camera.up.set(0, 0, 1);
  scene.add(new THREE.HemisphereLight(0xffffff, 0x9aa5b1, 0.75));
  const sun = new THREE.DirectionalLight(0xffffff, 0.6);
  sun.position.set(2, -3, 5);
  scene.add(sun);

  const base = new THREE.Group();
  scene.add(base);
  const links = PAGE.links.map(() => new THREE.Group());
  base.add(links[0]);
  const joints = {};
  for (const joint of PAGE.joints) {
    const group = links[joint.child];
    group.matrixAutoUpdate = false;
    joint.frame = new THREE.Matrix4().fromArray(joint.origin);
    joint.vector = new THREE.Vector3(...joint.axis);
    links[joint.parent].add(group);
    joints[joint.name] = joint;
    turn(joint, 0);
  }

  function turn(joint, value) {
    joint.value = value;
    const motion = new THREE.Matrix4();
    if (joint.kind === "prismatic") motion.makeTranslation(joint.vector.x * value, joint.vector.y * value, joint.vector.z * value);
    else if (joint.kind !== "fixed") motion.makeRotationAxis(joint.vector, value);
    links[joint.child].matrix.copy(joint.frame).multiply(motion);
    links[joint.child].matrixWorldNeedsUpdate = true;
    for (const follower of PAGE.joints) {
      if (follower.follows === joint.name && joint.name !== follower.name) turn(follower, follower.ratio * value + follower.offset);
    }
  }

  function place(pose) { // x y z qx qy qz qw
    base.position.set(pose[0], pose[1], pose[2]);
    base.quaternion.set(pose[3], pose[4], pose[5], pose[6]);
  }
  place(PAGE.base);
  for (const [name, value] of Object.entries(PAGE.angles)) if (joints[name]) turn(joints[name], value);

  const marks = { floor: new THREE.Group(), thrust: new THREE.Group(), labels: new THREE.Group(), axes: new THREE.Group() };
  const arrows = [];
  for (const rotor of PAGE.rotors) {
    const arrow = new THREE.ArrowHelper(new THREE.Vector3(...rotor.axis).normalize(), new THREE.Vector3(0, 0, 0), 0.1, 0xd9730d);
    arrow.userData.rotor = rotor;
    arrows.push(arrow);
    links[rotor.link].add(arrow);
  }
  function push(values) {
    arrows.forEach((arrow, i) => {
      const length = Math.abs(values[i]) * PAGE.newton;
      arrow.visible = length > 1e-4 && !marks.thrust.userData.off;
      if (values[i] < 0) arrow.setDirection(new THREE.Vector3(...PAGE.rotors[i].axis).negate().normalize());
      else arrow.setDirection(new THREE.Vector3(...PAGE.rotors[i].axis).normalize());
      if (length > 1e-4) arrow.setLength(length, Math.min(0.3 * length, 0.05), Math.min(0.15 * length, 0.025));
    });
  }
  let thrusts = PAGE.thrust;
  push(thrusts);

  function label(text) {
    const canvas = document.createElement("canvas");
    canvas.width = 256; canvas.height = 64;
    const pen = canvas.getContext("2d");
    pen.font = "34px sans-serif"; pen.textAlign = "center"; pen.fillStyle = "#1f2933";
    pen.strokeStyle = "#ffffff"; pen.lineWidth = 6;
    pen.strokeText(text, 128, 44); pen.fillText(text, 128, 44);
    const sprite = new THREE.Sprite(new THREE.SpriteMaterial({ map: new THREE.CanvasTexture(canvas), depthTest: false, transparent: true, sizeAttenuation: false }));
    sprite.scale.set(0.16, 0.04, 1);
    sprite.renderOrder = 10;
    return sprite;
  }
  for (const mark of PAGE.labels) {
    const sprite = label(mark.text);
    sprite.position.set(...mark.at);
    sprite.userData.label = true;
    links[mark.link].add(sprite);
  }
  const cog = new THREE.Mesh(new THREE.SphereGeometry(0.02 * PAGE.size, 24, 16), new THREE.MeshStandardMaterial({ color: 0xb3261e, depthTest: false, transparent: true, opacity: 0.85 }));
  scene.add(cog);
  function balance() { // the centre of gravity from the links' masses
    base.updateMatrixWorld(true);
    let total = 0;
    const sum = new THREE.Vector3();
    for (const part of PAGE.masses) {
      const point = new THREE.Vector3(...part.at).applyMatrix4(links[part.link].matrixWorld);
      sum.addScaledVector(point, part.mass);
      total += part.mass;
    }
    cog.visible = total > 0;
    if (total > 0) cog.position.copy(sum.divideScalar(total));
  }

  const grid = new THREE.GridHelper(Math.ceil(6 * PAGE.size), Math.ceil(6 * PAGE.size) * 2, 0xb8c4cf, 0xd9e0e7);
  grid.rotation.x = Math.PI / 2;
  marks.floor.add(grid);
  marks.axes.add(new THREE.AxesHelper(0.25 * PAGE.size));
  scene.add(marks.floor);
  base.add(marks.axes);
  for (const box of PAGE.obstacles) {
    const solid = new THREE.Mesh(new THREE.BoxGeometry(...box.size), new THREE.MeshStandardMaterial({ color: 0x7b8794, transparent: true, opacity: 0.45 }));
    solid.position.set(...box.at);
    solid.quaternion.set(...box.xyzw);
    scene.add(solid);
  }

  const controls = new THREE.TrackballControls(camera, renderer.domElement);
  controls.rotateSpeed = 3; controls.staticMoving = true;
  function draw() { balance(); renderer.render(scene, camera); }
  controls.addEventListener("change", draw);
  function resize() {
    const width = stage.clientWidth, height = stage.clientHeight;
    renderer.setPixelRatio(window.devicePixelRatio);
    renderer.setSize(width, height);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    controls.handleResize();
    draw();
  }
  function look() {
    const span = new THREE.Box3();
    base.updateMatrixWorld(true);
    base.traverse((part) => { if (part.isMesh) span.expandByObject(part); });
    if (span.isEmpty()) span.setFromCenterAndSize(base.position.clone(), new THREE.Vector3(PAGE.size, PAGE.size, PAGE.size));
    const sphere = span.getBoundingSphere(new THREE.Sphere());
    marks.floor.position.z = PAGE.floor === null ? span.min.z - 0.3 * PAGE.size : PAGE.floor;
    const far = 0.8 * sphere.radius / Math.sin(camera.fov * Math.PI / 360);
    camera.position.copy(sphere.center).add(new THREE.Vector3(0.5, -0.75, 0.45).normalize().multiplyScalar(far));
    controls.target.copy(sphere.center);
    controls.update();
  }

  const sliders = {};
  const where = document.getElementById("sliders");
  function group(title, open) {
    const details = document.createElement("details");
    details.open = open;
    const summary = document.createElement("summary");
    summary.textContent = title;
    details.append(summary);
    where.append(details);
    return details;
  }
  for (const [title, names] of PAGE.groups) {
    if (!names.length) continue;
    const home = group(title, title === PAGE.groups[0][0]);
    for (const name of names) {
      const joint = joints[name];
      const row = document.createElement("div");
      row.className = "joint";
      const text = document.createElement("span"); text.textContent = name; text.title = name;
      const slider = document.createElement("input");
      slider.type = "range"; slider.min = joint.low; slider.max = joint.high; slider.step = "any"; slider.value = joint.value;
      slider.setAttribute("aria-label", name);
      const shown = document.createElement("output");
      const unit = joint.kind === "prismatic" ? "m" : "rad";
      const say = () => { shown.textContent = joint.value.toFixed(2) + " " + unit; };
      slider.addEventListener("input", () => { turn(joint, Number(slider.value)); say(); draw(); });
      say();
      row.append(text, slider, shown);
      home.append(row);
      sliders[name] = () => { slider.value = joint.value; say(); };
    }
  }
  const toggles = document.getElementById("toggles");
  function toggle(title, change) {
    const box = document.createElement("label");
    const tick = document.createElement("input");
    tick.type = "checkbox"; tick.checked = true;
    tick.addEventListener("change", () => { change(tick.checked); draw(); });
    box.append(tick, " " + title);
    toggles.append(box);
  }
  toggle("numbers", (on) => base.traverse((part) => { if (part.userData.label) part.visible = on; }));
  toggle("floor", (on) => { marks.floor.visible = on; });
  toggle("root axes", (on) => { marks.axes.visible = on; });
  if (PAGE.rotors.length) toggle("thrusts", (on) => { marks.thrust.userData.off = !on; push(thrusts); });

  function pose(frame) {
    const flight = PAGE.flight;
    place(flight.base[frame]);
    flight.names.forEach((name, i) => { if (joints[name]) turn(joints[name], flight.angles[frame][i]); });
    if (flight.thrust.length) { thrusts = flight.thrust[frame]; push(thrusts); }
    for (const refresh of Object.values(sliders)) refresh();
    document.getElementById("clock").textContent = flight.time[frame].toFixed(1) + " s";
    draw();
  }
  new THREE.GLTFLoader().load("data:application/octet-stream;base64," + PAGE.glb, (gltf) => {
    const found = [];
    gltf.scene.traverse((part) => { const named = /^L(\d+)_/.exec(part.name); if (named) found.push([part, Number(named[1])]); });
    for (const [part, link] of found) links[link].add(part);
    base.traverse((part) => { if (part.isMesh && part.material.metalness) { part.material.metalness = 0; part.material.roughness = 0.6; } });
    start();
  }, undefined, start);

  function start() {
    document.getElementById("still").remove();
    stage.append(renderer.domElement);
    look();
    resize();
    window.addEventListener("resize", resize);
    (function loop() { requestAnimationFrame(loop); controls.update(); })();
    if (PAGE.flight) play();
    document.body.dataset.ready = "3d";
  }
  function play() {
    const flight = PAGE.flight, last = flight.time.length - 1;
    const bar = document.getElementById("when"), button = document.getElementById("play");
    document.getElementById("player").hidden = false;
    bar.max = last;
    let running = false, started = 0, from = 0;
    bar.addEventListener("input", () => { running = false; button.textContent = "play"; pose(Number(bar.value)); });
    button.addEventListener("click", () => {
      running = !running;
      button.textContent = running ? "pause" : "play";
      if (running) { if (Number(bar.value) >= last) bar.value = 0; started = performance.now(); from = flight.time[Number(bar.value)]; requestAnimationFrame(step); }
    });
    function step(now) {
      if (!running) return;
      const time = from + (now - started) / 1000;
      let frame = Number(bar.value);
      while (frame < last && flight.time[frame + 1] <= time) frame++;
      bar.value = frame;
      pose(frame);
      if (frame >= last) { running = false; button.textContent = "play"; return; }
      requestAnimationFrame(step);
    }
    pose(0);
    look();
    draw();
  }
})();
