model Motor "DC motor with a load on its shaft"
  parameter Real R(unit="Ohm", min=0.5, max=3) = 1.5 "resistance of the winding";
  parameter Real L(unit="H", min=0.0005, max=0.01) = 0.003 "inductance of the winding";
  parameter Real k(unit="N.m/A", min=0.02, max=0.1) = 0.06 "torque constant, and voltage per speed";
  parameter Real J(unit="kg.m2", min=5e-5, max=1e-3) = 3e-4 "inertia of rotor and load";
  parameter Real d(unit="N.m.s/rad", min=0, max=1e-3) = 1e-4 "viscous friction";
  parameter Real Tc(unit="N.m", min=0, max=0.1) = 0.02 "dry friction";
  input Real u(unit="V") "voltage of the amplifier";
  output Real y1(unit="A") "measured current";
  output Real y2(unit="rad/s") "measured speed";
  Real i(unit="A", start=0) "current";
  Real w(unit="rad/s", start=0) "speed";
equation
  L*der(i) = u - R*i - k*w;
  J*der(w) = k*i - d*w - Tc*sign(w);
  y1 = i;
  y2 = w;
end Motor;
