#include <chrono>
#include <cstdio>
#include <ctime>
#include <cstdlib>
#include <algorithm>
#include "dpr/dpr.hpp"
#include "experiments/pose_problems.hpp"
using namespace dpr;
double env(const char* n, double d){ const char* v=getenv(n); return v?atof(v):d; }
int main(int,char**argv){
  bench::PoseProblemSet set; set.object=argv[1]; set.initial_degrees=atof(argv[2]); set.seed=(uint64_t)env("SEED",1);
  set.translation_error=env("TERR",0); set.clutter=env("CLUTTER",0)>0; set.occluded=env("OCC",0);
  int n=atoi(argv[3]);
  auto problems=bench::make_pose_problems(set,(size_t)n);
  Device device=open_device(); Scene scene=bench::pose_scene(set.object);
  bench::RigidCamera camera(device,scene);
  PoseOptions options; LeastSquares ls; ls.rotations=(unsigned)env("ROT",ls.rotations); ls.coarsest=(unsigned)env("COARSE",ls.coarsest);
  ls.iterations=(unsigned)env("ITER",ls.iterations); ls.blur=(float)env("BLUR",(double)ls.blur); ls.blur_end=(float)env("FINE",0.1); ls.robust=(float)env("ROBUST",0);
  options.method=ls; options.solve_translation=set.translation_error>0; options.solve_focal=env("FOCAL",0)>0;
  std::vector<double> errs,times; int solved=0,s2=0,s5=0,same=0,tr=0; double sum=0;
  std::vector<double> z;
  for(int i=0;i<n;++i){ auto&p=problems[(size_t)i]; Image target=bench::make_target(camera,set,p);
    PoseSolver solver(device,scene,target,options);
    static std::vector<double> cpu(10000); double c0=(double)clock()/1e6; PoseSolver::Callback cb=[&](const PoseIteration&it){ static int last=0; static double lastc=0; double c=(double)clock()/1e6; if(it.iteration==0){last=0;lastc=c0;} if(true) cpu[(size_t)last]+=c-lastc; lastc=c; last=it.width; return true;};
 PoseResult r= set.initial_degrees>0? solver.solve(p.initial,cb): solver.search(cb); double cputime=(double)clock()/1e6-c0; if(i==n-1) for(size_t k=0;k<10000;++k) if(cpu[k]>0) printf("level %zu: %.3f cpu s a problem\n",k,cpu[k]/n);
    double e=angle_degrees(r.pose.rotation,p.truth.rotation); double d=bench::differing_pixels(camera.render(r.pose),target);
    double te=glm::length(r.pose.translation-p.truth.translation)/6.7;
    size_t np=options.solve_translation?6:3; double sd=0; if(!r.covariance.empty()) for(size_t k=0;k<3;++k) sd+=r.covariance[k*np+k]; sd=glm::degrees(std::sqrt(sd));
    double en=180; for(auto&q:r.equals) en=std::min(en,angle_degrees(q.pose.rotation,p.truth.rotation));
    if(env("V",0)>0|| e>5) printf("%3d err %7.3f sd %.3f te %.4f diff %.4f loss %.3e expl %d equals %zu nearest-equal %.2f it %u %.3fs\n",i,e,sd,te,d,r.loss,r.explained,r.equals.size(),en,r.iterations,r.seconds);
    if(env("V",0)>1) for(auto&h:r.history) printf("   it %u size %d hyps %u loss %.4e err %.3f\n",h.iteration,h.width,h.hypotheses,h.loss,angle_degrees(h.pose.rotation,p.truth.rotation));
    fflush(stdout);
    z.push_back(e/sd); errs.push_back(e); times.push_back(cputime); sum+=e; solved+=e<10; s2+=e<2; s5+=(e<5); tr+=(e<5&&te<0.02); same+= (e<10||d<1e-3);}
  std::sort(errs.begin(),errs.end()); std::sort(times.begin(),times.end());
  std::sort(z.begin(),z.end()); printf("err/sd median %.2f p90 %.2f\n", z[z.size()/2], z[z.size()*9/10]);
  printf("== n %d <10: %d  <5: %d <2: %d  6d: %d  solved-or-same: %d avg %.3f median %.3f p90 %.3f cpu med %.3f max %.3f\n",n,solved,s5,s2,tr,same,sum/n,errs[errs.size()/2],errs[errs.size()*9/10],times[times.size()/2],times.back());
}
