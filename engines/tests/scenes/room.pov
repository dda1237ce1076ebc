// CC0 1.0; written by make_scenes.py. +W128 +H96
#version 3.7;
#ifndef (Light_Samples) #declare Light_Samples = 4; #end
global_settings {
  assumed_gamma 1.0
  #ifdef (Radiosity) radiosity { count 60 error_bound 0.6 recursion_limit 2 pretrace_end 0.02 } #end
}
camera { perspective location <0, 1, -3.9> right x * image_width / image_height up y angle 39.0 look_at <0, 1, 0> }
light_source { <0, 1.97, 0> color rgb <275.02, 229.183, 137.51>
  area_light x * 0.6, z * 0.6, Light_Samples, Light_Samples
  fade_distance 0.05 fade_power 2 }
#declare T_white = texture { pigment { rgb <0.73, 0.71, 0.68> } finish { ambient 0 diffuse 1 } }
#declare T_red = texture { pigment { rgb <0.63, 0.065, 0.05> } finish { ambient 0 diffuse 1 } }
#declare T_green = texture { pigment { rgb <0.14, 0.45, 0.091> } finish { ambient 0 diffuse 1 } }
#declare T_lamp = texture { pigment { rgb <12.0, 10.0, 6.0> } finish { ambient 0 diffuse 0 emission 1 } }
#declare T_mark = texture { pigment { rgb <4.0, 2.0, 0.5> } finish { ambient 0 diffuse 0 emission 1 } }
polygon { 5, <-1, 0, -1>, <1, 0, -1>, <1, 0, 1>, <-1, 0, 1>, <-1, 0, -1> texture { T_white } } // floor
polygon { 5, <-1, 2, -1>, <-1, 2, 1>, <1, 2, 1>, <1, 2, -1>, <-1, 2, -1> texture { T_white } } // ceiling
polygon { 5, <-1, 0, 1>, <1, 0, 1>, <1, 2, 1>, <-1, 2, 1>, <-1, 0, 1> texture { T_white } } // back
polygon { 5, <-1, 0, -1>, <-1, 0, 1>, <-1, 2, 1>, <-1, 2, -1>, <-1, 0, -1> texture { T_red } } // left
polygon { 5, <1, 0, -1>, <1, 2, -1>, <1, 2, 1>, <1, 0, 1>, <1, 0, -1> texture { T_green } } // right
polygon { 5, <-0.3, 1.98, -0.3>, <-0.3, 1.98, 0.3>, <0.3, 1.98, 0.3>, <0.3, 1.98, -0.3>, <-0.3, 1.98, -0.3> texture { T_lamp } no_shadow } // lamp
polygon { 5, <-0.8, 1.4, 0.98>, <-0.5, 1.4, 0.98>, <-0.5, 1.52, 0.98>, <-0.8, 1.52, 0.98>, <-0.8, 1.4, 0.98> texture { T_mark } no_shadow } // mark
polygon { 5, <0.0446709007, 0, 0.44364846>, <-0.49364846, 0, 0.694670901>, <-0.49364846, 1.2, 0.694670901>, <0.0446709007, 1.2, 0.44364846>, <0.0446709007, 0, 0.44364846> texture { T_white } } // tall0
polygon { 5, <-0.49364846, 0, 0.694670901>, <-0.744670901, 0, 0.15635154>, <-0.744670901, 1.2, 0.15635154>, <-0.49364846, 1.2, 0.694670901>, <-0.49364846, 0, 0.694670901> texture { T_white } } // tall1
polygon { 5, <-0.744670901, 0, 0.15635154>, <-0.20635154, 0, -0.0946709007>, <-0.20635154, 1.2, -0.0946709007>, <-0.744670901, 1.2, 0.15635154>, <-0.744670901, 0, 0.15635154> texture { T_white } } // tall2
polygon { 5, <-0.20635154, 0, -0.0946709007>, <0.0446709007, 0, 0.44364846>, <0.0446709007, 1.2, 0.44364846>, <-0.20635154, 1.2, -0.0946709007>, <-0.20635154, 0, -0.0946709007> texture { T_white } } // tall3
polygon { 5, <0.0446709007, 1.2, 0.44364846>, <-0.49364846, 1.2, 0.694670901>, <-0.744670901, 1.2, 0.15635154>, <-0.20635154, 1.2, -0.0946709007>, <0.0446709007, 1.2, 0.44364846> texture { T_white } } // tall4
polygon { 5, <0.569047305, 0, 0.0625231148>, <0.0374768852, 0, -0.130952695>, <0.0374768852, 0.6, -0.130952695>, <0.569047305, 0.6, 0.0625231148>, <0.569047305, 0, 0.0625231148> texture { T_white } } // short0
polygon { 5, <0.0374768852, 0, -0.130952695>, <0.230952695, 0, -0.662523115>, <0.230952695, 0.6, -0.662523115>, <0.0374768852, 0.6, -0.130952695>, <0.0374768852, 0, -0.130952695> texture { T_white } } // short1
polygon { 5, <0.230952695, 0, -0.662523115>, <0.762523115, 0, -0.469047305>, <0.762523115, 0.6, -0.469047305>, <0.230952695, 0.6, -0.662523115>, <0.230952695, 0, -0.662523115> texture { T_white } } // short2
polygon { 5, <0.762523115, 0, -0.469047305>, <0.569047305, 0, 0.0625231148>, <0.569047305, 0.6, 0.0625231148>, <0.762523115, 0.6, -0.469047305>, <0.762523115, 0, -0.469047305> texture { T_white } } // short3
polygon { 5, <0.569047305, 0.6, 0.0625231148>, <0.0374768852, 0.6, -0.130952695>, <0.230952695, 0.6, -0.662523115>, <0.762523115, 0.6, -0.469047305>, <0.569047305, 0.6, 0.0625231148> texture { T_white } } // short4
