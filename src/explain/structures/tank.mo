model Tank "a tank with a free outflow (Torricelli); flows in units of the level a second"
  parameter Real pump_gain(min=0) = {rms:output}/({rms:input}*{time}) "flow for a unit of the input";
  parameter Real pump_offset = 0 "flow at input 0";
  parameter Real outflow(min=0) = sqrt({rms:output})/{time} "flow at level 1";
  input Real {input}{unit:input};
  output Real {output}{unit:output};
  Real {output:_level}(start={first});
equation
  der({output:_level}) = pump_gain*{input} + pump_offset - outflow*sqrt(max({output:_level}, 0));
  {output} = {output:_level};
end Tank;
