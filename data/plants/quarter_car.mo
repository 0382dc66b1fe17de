model QuarterCar "a wheel and its share of the body on a test rig; displacements from rest"
  final parameter Real ms(unit="kg") = 310 "share of the body, weighed";
  parameter Real mu(unit="kg", min=20, max=80) = 45 "wheel, with its share of the axle";
  parameter Real ks(unit="N/m", min=1e4, max=4e4) = 2e4 "spring at rest";
  parameter Real k3(unit="N/m3", min=0, max=1e7) = 1e6 "progression of the spring";
  parameter Real c(unit="N.s/m", min=500, max=4000) = 1500 "damper";
  parameter Real kt(unit="N/m", min=1e5, max=4e5) = 2e5 "tyre";
  input Real zr(unit="m") "position of the post under the tyre";
  output Real acc(unit="m/s2") "acceleration of the body";
  Real zs(unit="m", start=0) "position of the body";
  Real vs(unit="m/s", start=0) "velocity of the body";
  Real zu(unit="m", start=0) "position of the wheel";
  Real vu(unit="m/s", start=0) "velocity of the wheel";
  Real s(unit="m") = zu - zs "compression of the spring";
  Real F(unit="N") = ks*s + k3*s^3 + c*(vu - vs) "force on the body";
equation
  der(zs) = vs;
  der(zu) = vu;
  ms*der(vs) = F;
  mu*der(vu) = kt*(zr - zu) - F;
  acc = der(vs);
end QuarterCar;
