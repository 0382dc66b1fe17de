model Pendulum "pendulum on a gear motor"
  parameter Real m(unit="kg", min=0.3, max=0.7) = 0.42 "mass of the bob";
  parameter Real J(unit="kg.m2", min=0.001, max=0.03) = 0.01 "inertia of rotor and gear, at the shaft";
  parameter Real d(unit="N.m.s/rad", min=0.001, max=0.2) = 0.05 "viscous friction of the gear";
  parameter Real k(unit="N.m/V", min=0.05, max=0.5) = 0.2 "torque at the shaft per volt";
  final parameter Real l(unit="m") = 0.3 "distance of the bob from the shaft";
  input Real u(unit="V") "command of the amplifier";
  output Real y(unit="rad") "angle";
  Real phi(unit="rad", start=0) "angle from hanging";
  Real w(unit="rad/s", start=0) "angular velocity";
equation
  der(phi) = w;
  (J + m*l^2)*der(w) = k*u - d*w - m*Modelica.Constants.g_n*l*sin(phi);
  y = phi;
end Pendulum;
