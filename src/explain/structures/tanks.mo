model Tanks "two tanks, one above the other, each with a free outflow (Torricelli); levels and flows in units of the lower level"
  parameter Real pump_gain(min=0) = {rms:output}/({rms:input}*{time}) "flow for a unit of the input";
  parameter Real pump_offset = 0 "flow at input 0";
  parameter Real upper_outflow(min=0) = sqrt({rms:output})/{time} "flow at level 1";
  parameter Real lower_outflow(min=0) = sqrt({rms:output})/{time} "flow at level 1";
  input Real {input}{unit:input};
  output Real {output}{unit:output};
  Real {output:_upper}(start={rms:output});
  Real {output:_lower}(start={first});
equation
  der({output:_upper}) = pump_gain*{input} + pump_offset - upper_outflow*sqrt(max({output:_upper}, 0));
  der({output:_lower}) = upper_outflow*sqrt(max({output:_upper}, 0)) - lower_outflow*sqrt(max({output:_lower}, 0));
  {output} = {output:_lower};
end Tanks;
