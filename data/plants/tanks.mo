model Tanks "two tanks in series, filled by a pump"
  final parameter Real A1(unit="m2") = 0.0154 "cross-section of the upper tank, measured";
  final parameter Real A2(unit="m2") = 0.0154 "cross-section of the lower tank, measured";
  parameter Real a1(unit="m2", min=2e-5, max=1e-4) = 5e-5 "outlet of the upper tank, with contraction";
  parameter Real a2(unit="m2", min=2e-5, max=1e-4) = 5e-5 "outlet of the lower tank, with contraction";
  parameter Real kp(unit="m3/(s.V)", min=5e-6, max=5e-5) = 2e-5 "flow of the pump per volt";
  input Real u(unit="V") "voltage of the pump";
  output Real y1(unit="m") "level of the upper tank";
  output Real y2(unit="m") "level of the lower tank";
  Real h1(unit="m", min=0, start=0.2) "level of the upper tank";
  Real h2(unit="m", min=0, start=0.2) "level of the lower tank";
  Real q1(unit="m3/s") = a1*sqrt(2*Modelica.Constants.g_n*max(h1, 0)) "from the upper tank to the lower";
  Real q2(unit="m3/s") = a2*sqrt(2*Modelica.Constants.g_n*max(h2, 0)) "from the lower tank";
equation
  A1*der(h1) = kp*u - q1;
  A2*der(h2) = q1 - q2;
  y1 = h1;
  y2 = h2;
end Tanks;
